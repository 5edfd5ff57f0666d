/* Every operation of our N_Vector against its plain formula, for lengths around the block size. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "vector.h"

enum { LONGEST = 37, MANY = 9 };

static SUNContext context;
static double random_state = 0.5;

/* Repeatable numbers in -1 ... 1, none near 0. */
static double number(void)
{
    random_state = fmod(random_state * 9301.0 + 0.49297, 1.0);
    const double value = 2.0 * random_state - 1.0;
    return fabs(value) < 0.01 ? 0.5 : value;
}

static N_Vector vector(int64_t n)
{
    N_Vector made = gust_vector_new(n, context);
    assert_non_null(made);
    for (int64_t i = 0; i < n; ++i) {
        gust_vector_data(made)[i] = number();
    }
    return made;
}

static void near(double value, double expected)
{
    if (!(fabs(value - expected) <= 1e-14 * fmax(fabs(expected), 1.0))) {
        fail_msg("%.17g instead of %.17g", value, expected);
    }
}

/* Elements beyond the length must stay 0: every other operation counts on it. */
static void padding_is_zero(N_Vector v)
{
    const gust_vector *inside = v->content;
    for (int64_t i = inside->length; i < inside->padded; ++i) {
        assert_true(inside->data[i] == 0.0);
    }
}

static void elementwise(int64_t n)
{
    N_Vector x = vector(n);
    N_Vector y = vector(n);
    N_Vector z = N_VClone(x);
    const double *xd = N_VGetArrayPointer(x);
    const double *yd = N_VGetArrayPointer(y);
    const double *zd = N_VGetArrayPointer(z);
    assert_int_equal(N_VGetLength(z), n);
#define EACH(CALL, FORMULA)                                                                                    \
    CALL;                                                                                                      \
    padding_is_zero(z);                                                                                        \
    for (int64_t i = 0; i < n; ++i) {                                                                          \
        near(zd[i], FORMULA);                                                                                  \
    }
    EACH(N_VLinearSum(2.0, x, -3.0, y, z), 2.0 * xd[i] - 3.0 * yd[i])
    EACH(N_VConst(1.5, z), 1.5)
    EACH(N_VProd(x, y, z), xd[i] * yd[i])
    EACH(N_VDiv(x, y, z), xd[i] / yd[i])
    EACH(N_VScale(-0.5, x, z), -0.5 * xd[i])
    EACH(N_VScale(1.0, x, z), xd[i])
    EACH(N_VAbs(x, z), fabs(xd[i]))
    EACH(N_VInv(x, z), 1.0 / xd[i])
    EACH(N_VAddConst(x, 4.0, z), xd[i] + 4.0)
    EACH(N_VCompare(0.5, x, z), fabs(xd[i]) >= 0.5 ? 1.0 : 0.0)
#undef EACH
    /* in place */
    N_VScale(1.0, x, z);
    N_VLinearSum(2.0, z, 1.0, y, z);
    for (int64_t i = 0; i < n; ++i) {
        near(zd[i], 2.0 * xd[i] + yd[i]);
    }
    assert_int_equal(N_VInvTest(x, z), SUNTRUE);
    gust_vector_data(x)[n - 1] = 0.0;
    assert_int_equal(N_VInvTest(x, z), SUNFALSE);
    N_VDestroy(x);
    N_VDestroy(y);
    N_VDestroy(z);
}

static void reductions(int64_t n)
{
    N_Vector x = vector(n);
    N_Vector w = vector(n);
    N_Vector mask = gust_vector_new(n, context);
    const double *xd = gust_vector_data(x);
    const double *wd = gust_vector_data(w);
    double dot = 0.0, squares = 0.0, masked = 0.0, sum = 0.0, largest = 0.0, smallest = INFINITY,
           quotient = INFINITY;
    for (int64_t i = 0; i < n; ++i) {
        gust_vector_data(mask)[i] = i % 3 == 0 ? 1.0 : 0.0;
        dot += xd[i] * wd[i];
        squares += xd[i] * xd[i] * wd[i] * wd[i];
        masked += i % 3 == 0 ? xd[i] * xd[i] * wd[i] * wd[i] : 0.0;
        sum += fabs(xd[i]);
        largest = fmax(largest, fabs(xd[i]));
        smallest = fmin(smallest, xd[i]);
        quotient = fmin(quotient, xd[i] / wd[i]);
    }
    near(N_VDotProd(x, w), dot);
    near(N_VWrmsNorm(x, w), sqrt(squares / (double)n));
    near(N_VWrmsNormMask(x, w, mask), sqrt(masked / (double)n));
    near(N_VWL2Norm(x, w), sqrt(squares));
    near(N_VL1Norm(x), sum);
    near(N_VMaxNorm(x), largest);
    near(N_VMin(x), smallest);
    near(N_VMinQuotient(x, w), quotient);
    near(N_VWSqrSumLocal(x, w), squares);
    near(N_VWSqrSumMaskLocal(x, w, mask), masked);
    /* constraints: all satisfied, then one violated */
    N_Vector violated = N_VClone(x);
    for (int64_t i = 0; i < n; ++i) {
        gust_vector_data(mask)[i] = xd[i] > 0.0 ? 2.0 : -1.0;
    }
    assert_int_equal(N_VConstrMask(mask, x, violated), SUNTRUE);
    gust_vector_data(mask)[0] = -gust_vector_data(mask)[0];
    assert_int_equal(N_VConstrMask(mask, x, violated), SUNFALSE);
    near(gust_vector_data(violated)[0], 1.0);
    near(N_VL1Norm(violated), 1.0);
    N_VDestroy(x);
    N_VDestroy(w);
    N_VDestroy(mask);
    N_VDestroy(violated);
}

static void fused(int64_t n)
{
    N_Vector x[MANY];
    N_Vector y[MANY];
    N_Vector z[MANY];
    double c[MANY];
    double result[MANY];
    for (int k = 0; k < MANY; ++k) {
        x[k] = vector(n);
        y[k] = vector(n);
        z[k] = N_VClone(x[k]);
        c[k] = number();
    }
    for (int count = 1; count <= MANY; ++count) {
        assert_int_equal(N_VLinearCombination(count, c, x, z[0]), 0);
        padding_is_zero(z[0]);
        for (int64_t i = 0; i < n; ++i) {
            double expected = 0.0;
            for (int k = 0; k < count; ++k) {
                expected += c[k] * gust_vector_data(x[k])[i];
            }
            near(gust_vector_data(z[0])[i], expected);
        }
    }
    assert_int_equal(N_VScaleAddMulti(MANY, c, x[0], y, z), 0);
    for (int k = 0; k < MANY; ++k) {
        near(gust_vector_data(z[k])[n - 1],
             c[k] * gust_vector_data(x[0])[n - 1] + gust_vector_data(y[k])[n - 1]);
    }
    assert_int_equal(N_VLinearSumVectorArray(MANY, 2.0, x, 3.0, y, z), 0);
    for (int k = 0; k < MANY; ++k) {
        near(gust_vector_data(z[k])[0], 2.0 * gust_vector_data(x[k])[0] + 3.0 * gust_vector_data(y[k])[0]);
    }
    assert_int_equal(N_VScaleVectorArray(MANY, c, x, z), 0);
    assert_int_equal(N_VDotProdMulti(MANY, x[0], y, result), 0);
    for (int k = 0; k < MANY; ++k) {
        near(gust_vector_data(z[k])[0], c[k] * gust_vector_data(x[k])[0]);
        near(result[k], N_VDotProd(x[0], y[k]));
    }
    assert_int_equal(N_VWrmsNormVectorArray(MANY, x, y, result), 0);
    near(result[3], N_VWrmsNorm(x[3], y[3]));
    assert_int_equal(N_VConstVectorArray(MANY, 0.25, z), 0);
    near(gust_vector_data(z[MANY - 1])[n - 1], 0.25);
    padding_is_zero(z[MANY - 1]);
    for (int k = 0; k < MANY; ++k) {
        N_VDestroy(x[k]);
        N_VDestroy(y[k]);
        N_VDestroy(z[k]);
    }
}

static void all_lengths(void **state)
{
    (void)state;
    for (int64_t n = 1; n <= LONGEST; ++n) {
        elementwise(n);
        reductions(n);
        fused(n);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(all_lengths)};
    if (SUNContext_Create(GUST_NO_COMMUNICATOR, &context) != 0) {
        return 1;
    }
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    SUNContext_Free(&context);
    return failed;
}
