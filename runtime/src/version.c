#include <klu.h>
#include <sundials/sundials_config.h>

#include "gustform/gust_sim.h"

#define TEXT_OF(number) #number
#define TEXT(number)    TEXT_OF(number)

const char *gust_sundials_version(void)
{
    return SUNDIALS_VERSION;
}

const char *gust_klu_version(void)
{
    return TEXT(KLU_MAIN_VERSION) "." TEXT(KLU_SUB_VERSION) "." TEXT(KLU_SUBSUB_VERSION);
}
