#include "gustform/gust_status.h"

#include <stddef.h>

typedef struct status_row {
    gust_status status;
    const char *name;
    const char *text;
} status_row;

static const status_row STATUSES[] = {
#define STATUS_ROW(name, number, sentence) {GUST_##name, #name, sentence},
    GUST_STATUS_LIST(STATUS_ROW)
#undef STATUS_ROW
};

enum { N_STATUSES = sizeof STATUSES / sizeof STATUSES[0] };

static const status_row *find(gust_status status)
{
    for (int i = 0; i < N_STATUSES; ++i) {
        if (STATUSES[i].status == status) {
            return &STATUSES[i];
        }
    }
    return NULL;
}

const char *gust_status_name(gust_status status)
{
    const status_row *row = find(status);
    return row != NULL ? row->name : "UNKNOWN";
}

const char *gust_status_text(gust_status status)
{
    const status_row *row = find(status);
    return row != NULL ? row->text : "a status number outside the list";
}

gust_status gust_status_list(int index)
{
    return index >= 0 && index < N_STATUSES ? STATUSES[index].status : GUST_OK;
}
