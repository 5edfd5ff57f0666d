/* Nothing allocates after gust_bridge_init: the linker sends every allocation of this program through here. */
#include "stand.h"

#include <stdlib.h>

#include "../../../tests/c/allocations.h"
#include "gustform_bridge/report.h"

static stand s;

static void nothing_allocates(void **unused)
{
    (void)unused;
    void *volatile block = malloc(16);
    free(block);
    assert_true(allocations > 0); /* the wrapping works */
    const long before = allocations;
    stand_begin(&s, &test_database, false);
    stand_run(&s);
    for (uint32_t k = 0; k < 20U; ++k) {
        stand_request(&s, k % 3U, TEST_K_DROOP, 1.0);
        stand_send(&s, GUST_PART_SET_POINTS, 0, (double[32]){[2] = 1.0});
        stand_periods(&s, 100);
        stand_emergency(&s);
        stand_periods(&s, 10);
        gust_bus_off(&s.bus.node[0]);
        stand_periods(&s, 10);
        gust_bus_restart(&s.bus.node[0]);
        stand_run(&s);
    }
    assert_int_equal(allocations, before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(nothing_allocates)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
