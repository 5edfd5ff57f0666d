/* Parameters over the bus: read, write, activate, in each state, good and bad. */
#include "stand.h"

enum { READ, WRITE, ACTIVATE };
enum { DONE, UNKNOWN, RANGE, STATE };

static stand s;

static double ask(double operation, double id, double value)
{
    stand_request(&s, operation, id, value);
    stand_period(&s);
    for (int k = 1; s.heard.responses == 0 && k < GUST_TURNS; ++k) { /* others may be first */
        stand_period(&s);
    }
    assert_int_equal(s.heard.responses, 1);
    assert_true(s.heard.operation == operation);
    return s.heard.result;
}

static void read_write_activate(void **unused)
{
    (void)unused;
    stand_begin(&s, &test_database, true);
    stand_ready(&s);
    assert_true(ask(READ, TEST_K_DROOP, 0.0) == DONE && s.heard.value == 0.5);
    assert_true(s.heard.parameter == TEST_K_DROOP);
    assert_true(ask(READ, 999, 0.0) == UNKNOWN);
    assert_true(ask(WRITE, 999, 1.0) == UNKNOWN);
    assert_true(ask(WRITE, TEST_K_DROOP, 10.5) == RANGE && s.heard.value == 0.5);
    assert_true(ask(WRITE, TEST_K_DROOP, -0.5) == RANGE && s.heard.value == 0.5);
    assert_true(ask(WRITE, TEST_K_DROOP, 2.0) == DONE && s.heard.value == 2.0);
    s.v_dc = 1.125;
    stand_press(&s, GUST_COMMAND_START);
    stand_period(&s);
    assert_true(s.heard.omega_gsc == 1.0625); /* staged, not active */
    stand_press(&s, GUST_COMMAND_STOP);
    stand_period(&s);
    assert_true(ask(ACTIVATE, 0, 0.0) == DONE);
    stand_press(&s, GUST_COMMAND_START);
    stand_period(&s);
    assert_true(s.heard.omega_gsc == 1.25);
    assert_int_equal(stand_state(&s), GUST_STATE_RUN);
}

/* Each value is in its range, together they are too much: nothing is taken over, and what was staged is given
 * up. */
static void all_or_nothing(void **unused)
{
    (void)unused;
    stand_begin(&s, &test_database, true);
    stand_ready(&s);
    assert_true(ask(WRITE, TEST_K_DROOP, 8.0) == DONE);
    assert_true(ask(WRITE, TEST_K_PITCH, 900.0) == DONE);
    assert_true(ask(ACTIVATE, 0, 0.0) == RANGE);
    assert_true(ask(READ, TEST_K_DROOP, 0.0) == DONE && s.heard.value == 0.5);
    assert_true(ask(READ, TEST_K_PITCH, 0.0) == DONE && s.heard.value == 100.0);
    s.v_dc = 1.125;
    stand_run(&s);
    stand_periods(&s, 10);
    assert_true(s.heard.omega_gsc == 1.0625);
    assert_int_equal(stand_state(&s), GUST_STATE_RUN); /* the controller's error was cleared */
}

static void states(void **unused)
{
    (void)unused;
    for (int tune = 0; tune < 2; ++tune) {
        stand_begin(&s, &test_database, true);
        s.bridge.parameters.in_run = tune != 0;
        assert_true(ask(READ, TEST_K_DROOP, 0.0) == DONE); /* INIT */
        assert_true(ask(WRITE, TEST_K_DROOP, 1.0) == STATE);
        assert_true(ask(ACTIVATE, 0, 0.0) == STATE);
        stand_run(&s);
        s.v_dc = 1.125;
        assert_true(ask(READ, TEST_K_DROOP, 0.0) == DONE && s.heard.value == 0.5);
        assert_true(ask(WRITE, TEST_K_DROOP, 1.0) == (tune != 0 ? DONE : STATE));
        assert_true(s.heard.omega_gsc == 1.0625);
        assert_true(ask(ACTIVATE, 0, 0.0) == (tune != 0 ? DONE : STATE));
        stand_period(&s);
        assert_true(s.heard.omega_gsc == (tune != 0 ? 1.125 : 1.0625));
        stand_emergency(&s);
        stand_period(&s);
        assert_int_equal(stand_state(&s), GUST_STATE_SAFE);
        assert_true(ask(READ, TEST_K_DROOP, 0.0) == DONE);
        assert_true(ask(WRITE, TEST_K_DROOP, 3.0) == STATE);
        assert_true(ask(ACTIVATE, 0, 0.0) == STATE);
    }
}

/* Of several requests in a period, the last is answered: a flood does not become one of answers. */
static void one_answer_a_period(void **unused)
{
    (void)unused;
    stand_begin(&s, &test_database, true);
    stand_ready(&s);
    stand_request(&s, WRITE, TEST_K_DROOP, 4.0);
    stand_request(&s, READ, TEST_K_PITCH, 0.0);
    stand_period(&s);
    assert_int_equal(s.heard.responses, 1);
    assert_true(s.heard.value == 100.0);
    assert_true(ask(READ, TEST_K_DROOP, 0.0) == DONE && s.heard.value == 0.5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(read_write_activate), cmocka_unit_test(all_or_nothing),
                                       cmocka_unit_test(states), cmocka_unit_test(one_answer_a_period)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
