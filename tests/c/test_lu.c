/* Factors against plain matrix products, for sizes on both sides of where the inverse is used. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "lanes.h"
#include "linear.h"

enum { LARGEST = 90 };

typedef struct sparse {
    int32_t n;
    int32_t column_start[LARGEST + 1];
    int32_t row_index[LARGEST * LARGEST];
    double values[LARGEST * LARGEST];
} sparse;

static uint32_t random_state = 12345;

static double number(void)
{
    random_state = random_state * 1664525U + 1013904223U;
    return (double)random_state / 4294967296.0;
}

/* Diagonally dominant, so that it is regular; rows of very different size, as of physical equations. */
static void fill(sparse *a, int32_t n, double density)
{
    int32_t used = 0;
    a->n = n;
    for (int32_t column = 0; column < n; ++column) {
        a->column_start[column] = used;
        for (int32_t row = 0; row < n; ++row) {
            const double size = pow(10.0, (double)(row % 7) - 3.0);
            if (row == column) {
                a->row_index[used] = row;
                a->values[used++] = size * (4.0 + number());
            } else if (number() < density) {
                a->row_index[used] = row;
                a->values[used++] = size * (2.0 * number() - 1.0);
            }
        }
    }
    a->column_start[n] = used;
}

static void check_solve(const sparse *a, gust_factors *factors)
{
    double right[LARGEST + GUST_LANE_BLOCK] = {0.0};
    double solution[LARGEST + GUST_LANE_BLOCK];
    double left[LARGEST] = {0.0};
    for (int32_t i = 0; i < a->n; ++i) {
        right[i] = pow(10.0, (double)(i % 7) - 3.0) * (2.0 * number() - 1.0);
    }
    memcpy(solution, right, sizeof right);
    gust_factors_solve(factors, solution, solution); /* in place */
    for (int32_t column = 0; column < a->n; ++column) {
        for (int32_t k = a->column_start[column]; k < a->column_start[column + 1]; ++k) {
            left[a->row_index[k]] += a->values[k] * solution[column];
        }
    }
    for (int32_t i = 0; i < a->n; ++i) {
        /* conditioned by the diagonal dominance: a few digits above rounding */
        assert_true(fabs(left[i] - right[i]) <= 1e-11 * pow(10.0, (double)(i % 7) - 3.0));
    }
}

static void solves(void **state)
{
    (void)state;
    static sparse a;
    for (int32_t n = 1; n <= LARGEST; n += n < 12 ? 1 : 13) {
        fill(&a, n, 4.0 / (double)(n + 4));
        klu_common common;
        klu_defaults(&common);
        klu_symbolic *symbolic = klu_analyze(n, a.column_start, a.row_index, &common);
        assert_non_null(symbolic);
        gust_factors factors;
        assert_true(gust_factors_start(&factors, n, a.column_start, a.row_index, symbolic, &common));
        factors.growth_check = 1;
        for (int round = 0; round < 3; ++round) {
            assert_true(gust_factors_set(&factors, a.values));
            for (int k = 0; k < 3 * GUST_LU_PATIENCE; ++k) {
                check_solve(&a, &factors);
            }
            for (int32_t k = 0; k < a.column_start[n]; ++k) {
                a.values[k] *= 1.0 + 0.1 * number();
            }
        }
        assert_int_equal(factors.factorisations, 1);
        assert_int_equal(factors.refactorisations, 2);
        gust_factors_free(&factors);
        klu_free_symbolic(&symbolic, &common);
    }
}

/* [[a, 1], [1, b]] with a = 1, then a = 1e-14: the pivot a has become useless. */
static void new_pivots(void **state)
{
    (void)state;
    const int32_t column_start[] = {0, 2, 4};
    const int32_t row_index[] = {0, 1, 0, 1};
    double values[] = {4.0, 1.0, 1.0, 3.0};
    klu_common common;
    klu_defaults(&common);
    gust_factors factors;
    gust_factors_start(&factors, 2, column_start, row_index, NULL, &common);
    klu_symbolic *symbolic = klu_analyze(2, factors.column_start, factors.row_index, &common);
    factors.symbolic = symbolic;
    factors.growth_check = 1;
    assert_true(gust_factors_set(&factors, values));
    values[0] = 1e-14;
    assert_true(gust_factors_set(&factors, values));
    assert_int_equal(factors.factorisations, 2);
    double x[GUST_LANE_BLOCK] = {1.0, 4.0}; /* x = (1, 1) up to 1e-14 */
    gust_factors_solve(&factors, x, x);
    assert_true(fabs(x[0] - 1.0) < 1e-12 && fabs(x[1] - 1.0) < 1e-12);
    /* singular: [[1, 1], [1, 1]] */
    values[0] = values[3] = 1.0;
    assert_false(gust_factors_set(&factors, values));
    assert_true(factors.singular_column == 0 || factors.singular_column == 1);
    values[3] = NAN;
    assert_false(gust_factors_set(&factors, values));
    /* and regular again */
    values[3] = 3.0;
    assert_true(gust_factors_set(&factors, values));
    gust_factors_free(&factors);
    klu_free_symbolic(&symbolic, &common);
}

/* Solution for the values of a. */
static void solution_of(gust_factors *factors, const sparse *a, double *x)
{
    for (int32_t i = 0; i < LARGEST + GUST_LANE_BLOCK; ++i) {
        x[i] = i < a->n ? 1.0 + 0.37 * i : 0.0;
    }
    assert_true(gust_factors_set(factors, a->values));
    gust_factors_solve(factors, x, x);
}

/* Pivots go from one factorisation to another by way of an archive: the same bits come out, which pivots of its
 * own choice would not give. */
static void pivots_travel(void **state)
{
    (void)state;
    static sparse a;
    static unsigned char bytes[LARGEST * LARGEST * 8 + 1000];
    const int32_t n = 40;
    fill(&a, n, 0.2);
    klu_common common;
    klu_defaults(&common);
    klu_symbolic *symbolic = klu_analyze(n, a.column_start, a.row_index, &common);
    gust_factors first;
    gust_factors second;
    assert_true(gust_factors_start(&first, n, a.column_start, a.row_index, symbolic, &common));
    assert_true(gust_factors_start(&second, n, a.column_start, a.row_index, symbolic, &common));
    double x[2][LARGEST + GUST_LANE_BLOCK];
    /* diagonals too small for pivots, but for rounding of no use to what follows */
    static sparse other;
    other = a;
    for (int32_t column = 0; column < n; ++column) {
        for (int32_t k = a.column_start[column]; k < a.column_start[column + 1]; ++k) {
            other.values[k] *= a.row_index[k] == column && column % 3 == 0 ? 1e-5 : 1.0;
        }
    }
    solution_of(&first, &other, x[0]);
    solution_of(&first, &a, x[0]);
    solution_of(&second, &a, x[1]);
    assert_memory_not_equal(x[0], x[1], (size_t)n * sizeof x[0][0]);
    gust_archive archive;
    gust_archive_begin(&archive, bytes, sizeof bytes);
    gust_factors_archive(&first, &archive);
    gust_archive_seal(&archive, "PIVOTS..", 1);
    assert_int_equal(gust_archive_open(&archive, bytes, archive.at, "PIVOTS..", 1), GUST_ARCHIVE_SOUND);
    gust_factors_archive(&second, &archive);
    assert_true(archive.good && gust_factors_choose_again(&second));
    solution_of(&first, &a, x[0]);
    solution_of(&second, &a, x[1]);
    assert_memory_equal(x[0], x[1], (size_t)n * sizeof x[0][0]);
    gust_factors_free(&first);
    gust_factors_free(&second);
    klu_free_symbolic(&symbolic, &common);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(solves), cmocka_unit_test(new_pivots),
                                       cmocka_unit_test(pivots_travel)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
