#include "support.h"

#include <math.h>
#include <string.h>

gust_sim *new_sim(const gust_model *model, double rtol)
{
    gust_sim *sim = NULL;
    assert_int_equal(gust_sim_create(model, &sim), GUST_OK);
    assert_int_equal(gust_sim_set_option(sim, "rtol", rtol), GUST_OK);
    return sim;
}

void initialise(gust_sim *sim, double t0)
{
    const gust_status status = gust_sim_initialise(sim, t0);
    if (status != GUST_OK) {
        fail_msg("%s: %s", gust_status_name(status), gust_sim_message(sim));
    }
}

void advance(gust_sim *sim, double until)
{
    double reached = NAN;
    const gust_status status = gust_sim_advance(sim, until, &reached);
    if (status != GUST_OK) {
        fail_msg("%s: %s", gust_status_name(status), gust_sim_message(sim));
    }
    assert_true(reached == until);
    assert_true(gust_sim_time(sim) == until);
}

void unknowns(gust_sim *sim, double *y)
{
    assert_int_equal(gust_sim_state(sim, NULL, y, NULL), GUST_OK);
}

void assert_close(double value, double expected, double relative, const char *what)
{
    if (!(fabs(value - expected) <= relative * fmax(fabs(expected), 1e-3))) {
        fail_msg("%s: %.12g instead of %.12g", what, value, expected);
    }
}

void assert_says(const char *message, const char *part)
{
    if (strstr(message, part) == NULL) {
        fail_msg("\"%s\" does not say \"%s\"", message, part);
    }
}

int collect(void *context, int64_t rows, const double *time, const float *values)
{
    record *to = context;
    ++to->blocks;
    to->largest_block = rows > to->largest_block ? rows : to->largest_block;
    for (int64_t r = 0; r < rows && to->rows < RECORD_ROWS; ++r, ++to->rows) {
        to->time[to->rows] = time[r];
        for (int32_t k = 0; k < to->n_channels && k < RECORD_CHANNELS; ++k) {
            to->value[to->rows][k] = values[r * to->n_channels + k];
        }
    }
    return to->answer != 0 && to->rows >= to->answer_row ? to->answer : 0;
}
