/* The differences between SUNDIALS 6.4 and 7.x that the runtime meets, in one place. */
#ifndef GUSTFORM_SUNDIALS_COMPAT_H
#define GUSTFORM_SUNDIALS_COMPAT_H

#include <sundials/sundials_config.h>

/* SUNDIALS headers are not written for our warnings. */
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpedantic"
#pragma GCC diagnostic ignored "-Wstrict-prototypes"
#endif
#if defined(GUSTFORM_IDAS)
#include <idas/idas.h> /* the same functions, and sensitivities that are not used here */
#else
#include <ida/ida.h>
#endif
#include <sundials/sundials_context.h>
#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>
#include <sundials/sundials_nonlinearsolver.h>
#include <sundials/sundials_nvector.h>
#include <sundials/sundials_types.h>
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

#if SUNDIALS_VERSION_MAJOR < 6 || (SUNDIALS_VERSION_MAJOR == 6 && SUNDIALS_VERSION_MINOR < 4)
#error "SUNDIALS 6.4 or later is needed"
#endif

#if !defined(SUNDIALS_DOUBLE_PRECISION)
#error "a SUNDIALS built for double precision is needed"
#endif

/* The communicator argument became a type of its own in 7. */
#if SUNDIALS_VERSION_MAJOR >= 7
#define GUST_NO_COMMUNICATOR SUN_COMM_NULL
#else
#define GUST_NO_COMMUNICATOR NULL
#endif

/* Renamed in 7, where errors of packages joined the common error codes. */
#if SUNDIALS_VERSION_MAJOR >= 7
#define GUST_LINEAR_SOLVER_LOST SUN_ERR_EXT_FAIL
#define GUST_NONLINEAR_SOLVED   SUN_SUCCESS
#define GUST_NONLINEAR_LOST     SUN_ERR_EXT_FAIL
#else
#define GUST_LINEAR_SOLVER_LOST SUNLS_PACKAGE_FAIL_UNREC
#define GUST_NONLINEAR_SOLVED   SUN_NLS_SUCCESS
#define GUST_NONLINEAR_LOST     SUN_NLS_MEM_NULL
#endif

#endif
