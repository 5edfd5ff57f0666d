/* The bare program: one flat DAE, plain IDA, the distribution's serial vectors, sparse matrix and KLU.
 *
 * What an engineer would write first: the residual and Jacobian that CasADi generated (flat.c), a wind
 * series read into memory, one call of IDASolve per stop. No result is written.
 *
 *     bare SETTINGS WIND    SETTINGS: text with n, start values etc.; WIND: doubles, uniform
 * prints: steps residual_evaluations seconds
 */
#include <ida/ida.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <sundials/sundials_config.h>
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>
#include <time.h>

#include "flat.h"

static double *wind;
static long n_wind;
static double wind_step;
static double *changing;
static int n_inputs;
static double *inputs;
static int n;

static void evaluate_inputs(double t)
{
    double s = t / wind_step;
    long k = (long)s;
    k = k < 0 ? 0 : (k > n_wind - 2 ? n_wind - 2 : k);
    const double fraction = s - (double)k;
    for (int i = 0; i < n_inputs; ++i) {
        inputs[i] = wind[k * n_inputs + i] + fraction * (wind[(k + 1) * n_inputs + i] - wind[k * n_inputs + i]);
    }
}

static int residual(realtype t, N_Vector y, N_Vector yp, N_Vector r, void *user)
{
    (void)user;
    evaluate_inputs(t);
    const double *arguments[8] = {N_VGetArrayPointer(y), N_VGetArrayPointer(yp), inputs, changing};
    double *results[4] = {N_VGetArrayPointer(r)};
    static casadi_int iw[1 << 16];
    static double w[1 << 20];
    return residual_function(arguments, results, iw, w, 0);
}

static int jacobian(realtype t, realtype cj, N_Vector y, N_Vector yp, N_Vector r, SUNMatrix J, void *user,
                    N_Vector t1, N_Vector t2, N_Vector t3)
{
    (void)r;
    (void)user;
    (void)t1;
    (void)t2;
    (void)t3;
    evaluate_inputs(t);
    const casadi_int *pattern = jacobian_function_sparsity_out(0);
    const casadi_int *column_start = pattern + 2;
    const casadi_int *row = pattern + 2 + n + 1;
    for (int c = 0; c <= n; ++c) {
        SM_INDEXPTRS_S(J)[c] = (sunindextype)column_start[c];
    }
    for (casadi_int k = 0; k < column_start[n]; ++k) {
        SM_INDEXVALS_S(J)[k] = (sunindextype)row[k];
    }
    const double *arguments[8] = {N_VGetArrayPointer(y), N_VGetArrayPointer(yp), inputs, changing, &cj};
    double *results[4] = {SM_DATA_S(J)};
    static casadi_int iw[1 << 16];
    static double w[1 << 20];
    return jacobian_function(arguments, results, iw, w, 0);
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double number(FILE *file)
{
    double value = 0.0;
    if (fscanf(file, "%lf", &value) != 1) {
        fprintf(stderr, "bare: settings end early\n");
        exit(1);
    }
    return value;
}

static void check(int flag, const char *what)
{
    if (flag < 0) {
        fprintf(stderr, "bare: %s failed with %d\n", what, flag);
        exit(1);
    }
}

int main(int argc, char **argv)
{
    if (argc != 3) {
        return 2;
    }
    FILE *settings = fopen(argv[1], "r");
    FILE *wind_file = fopen(argv[2], "rb");
    if (settings == NULL || wind_file == NULL) {
        return 2;
    }
    n = (int)number(settings);
    n_inputs = (int)number(settings);
    const int n_changing = (int)number(settings);
    const int n_stops = (int)number(settings);
    const double rtol = number(settings);
    const double until = number(settings);
    wind_step = number(settings);
    n_wind = (long)number(settings);
    inputs = malloc(sizeof(double) * (size_t)(n_inputs + 1));
    changing = malloc(sizeof(double) * (size_t)(n_changing + 1));
    wind = malloc(sizeof(double) * (size_t)(n_wind * n_inputs));
    if (fread(wind, sizeof(double), (size_t)(n_wind * n_inputs), wind_file) != (size_t)(n_wind * n_inputs)) {
        return 2;
    }
    for (int i = 0; i < n_changing; ++i) {
        changing[i] = number(settings);
    }
    SUNContext context;
    SUNContext_Create(NULL, &context);
    N_Vector y = N_VNew_Serial(n, context);
    N_Vector yp = N_VNew_Serial(n, context);
    N_Vector id = N_VNew_Serial(n, context);
    N_Vector atol = N_VNew_Serial(n, context);
    for (int i = 0; i < n; ++i) {
        NV_Ith_S(y, i) = number(settings);
        NV_Ith_S(id, i) = number(settings);
        NV_Ith_S(atol, i) = number(settings);
        NV_Ith_S(yp, i) = 0.0;
    }
    const casadi_int *pattern = jacobian_function_sparsity_out(0);
    SUNMatrix A = SUNSparseMatrix(n, n, (sunindextype)pattern[2 + n], CSC_MAT, context);
    SUNLinearSolver solver = SUNLinSol_KLU(y, A, context);
    void *ida = IDACreate(context);
    check(IDAInit(ida, residual, 0.0, y, yp), "IDAInit");
    check(IDASVtolerances(ida, rtol, atol), "tolerances");
    check(IDASetLinearSolver(ida, solver, A), "linear solver");
    check(IDASetJacFn(ida, jacobian), "jacobian");
    check(IDASetId(ida, id), "id");
    check(IDASetSuppressAlg(ida, 1), "suppress");
    check(IDASetMaxNumSteps(ida, -1), "steps");
    const double begin = now();
    long total = 0;
    long residuals = 0;
    double t = 0.0;
    check(IDACalcIC(ida, IDA_YA_YDP_INIT, 1e-3), "IDACalcIC");
    check(IDAGetConsistentIC(ida, y, yp), "consistent values");
    for (int stop = 0; stop <= n_stops; ++stop) {
        const double target = stop < n_stops ? number(settings) : until;
        if (target < until || stop == n_stops) {
            check(IDASetStopTime(ida, target), "stop time");
            while (t < target) {
                check(IDASolve(ida, target, &t, y, yp, IDA_NORMAL), "IDASolve");
            }
        }
        long steps = 0;
        long evaluations = 0;
        IDAGetNumSteps(ida, &steps);
        IDAGetNumResEvals(ida, &evaluations);
        total += steps;
        residuals += evaluations;
        if (stop < n_stops) {
            const int index = (int)number(settings);
            changing[index] = number(settings);
            check(IDAReInit(ida, t, y, yp), "IDAReInit");
            check(IDACalcIC(ida, IDA_YA_YDP_INIT, t + 1e-3), "IDACalcIC");
            check(IDAGetConsistentIC(ida, y, yp), "consistent values");
        }
    }
    printf("%ld %ld %.6f", total, residuals, now() - begin);
    for (int i = 0; i < n; ++i) {
        printf(" %.17g", NV_Ith_S(y, i));
    }
    printf("\n");
    return 0;
}
