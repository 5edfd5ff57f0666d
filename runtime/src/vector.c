#include "vector.h"

#include <math.h>
#include <string.h>

#include "lanes.h"
#include "memory.h"

/* Numbers of vectors that IDA combines at once: order + 1 = 6 at most, and one more. */
enum { MAX_FUSED = 7 };

static inline const gust_vector *content(N_Vector vector)
{
    return vector->content;
}

/* Data of a vector, with what the compiler may know about it. */
static inline double *data_of(N_Vector vector)
{
    return __builtin_assume_aligned(((gust_vector *)vector->content)->data, 64);
}

/* The same as lanes, and how many there are. */
static inline gust_lanes *lanes_of(N_Vector vector)
{
    return gust_lanes_of(content(vector)->data);
}

static inline int64_t lane_count(N_Vector vector)
{
    return (int64_t)((uint64_t)content(vector)->padded / GUST_LANES);
}

/* -- life ----------------------------------------------------------------------------------------------- */

static N_Vector_ID get_id(N_Vector vector)
{
    (void)vector;
    return SUNDIALS_NVEC_CUSTOM;
}

static N_Vector clone_empty(N_Vector vector)
{
    N_Vector made = N_VNewEmpty(vector->sunctx);
    if (made == NULL) {
        return NULL;
    }
    gust_vector *inside = gust_allocate(1, sizeof *inside);
    if (inside == NULL || N_VCopyOps(vector, made) != 0) {
        gust_release(inside);
        N_VFreeEmpty(made);
        return NULL;
    }
    inside->length = content(vector)->length;
    inside->padded = content(vector)->padded;
    made->content = inside;
    return made;
}

static void destroy(N_Vector vector)
{
    if (vector == NULL) {
        return;
    }
    gust_vector *inside = vector->content;
    if (inside != NULL) {
        gust_release(inside->data);
        gust_release(inside);
    }
    vector->content = NULL;
    N_VFreeEmpty(vector);
}

static N_Vector clone(N_Vector vector)
{
    N_Vector made = clone_empty(vector);
    if (made == NULL) {
        return NULL;
    }
    gust_vector *inside = made->content;
    inside->data = gust_allocate((size_t)inside->padded, sizeof(double));
    if (inside->data == NULL) {
        destroy(made);
        return NULL;
    }
    return made;
}

static void space(N_Vector vector, sunindextype *reals, sunindextype *integers)
{
    *reals = (sunindextype)content(vector)->padded;
    *integers = 2;
}

static sunrealtype *get_array(N_Vector vector)
{
    return content(vector)->data;
}

static sunindextype get_length(N_Vector vector)
{
    return (sunindextype)content(vector)->length;
}

/* -- standard operations -------------------------------------------------------------------------------- */

/* z may be x or y, so these loops must not promise otherwise; element by element that is harmless. */

static void linear_sum(sunrealtype a, N_Vector x, sunrealtype b, N_Vector y, N_Vector z)
{
    const int64_t n = lane_count(x);
    const gust_lanes *xd = lanes_of(x);
    const gust_lanes *yd = lanes_of(y);
    gust_lanes *zd = lanes_of(z);
    for (int64_t i = 0; i < n; ++i) {
        zd[i] = a * xd[i] + b * yd[i];
    }
}

static void set_constant(sunrealtype c, N_Vector z)
{
    if (c == 0.0) {
        const int64_t n_lanes = lane_count(z);
        gust_lanes *lanes = lanes_of(z);
        for (int64_t i = 0; i < n_lanes; ++i) {
            lanes[i] = (gust_lanes){0.0};
        }
        return;
    }
    const int64_t n = content(z)->length;
    double *zd = data_of(z);
    for (int64_t i = 0; i < n; ++i) {
        zd[i] = c;
    }
}

static void product(N_Vector x, N_Vector y, N_Vector z)
{
    const int64_t n = lane_count(x);
    const gust_lanes *xd = lanes_of(x);
    const gust_lanes *yd = lanes_of(y);
    gust_lanes *zd = lanes_of(z);
    for (int64_t i = 0; i < n; ++i) {
        zd[i] = xd[i] * yd[i];
    }
}

static void divide(N_Vector x, N_Vector y, N_Vector z)
{
    const int64_t n = content(x)->length;
    const double *xd = data_of(x);
    const double *yd = data_of(y);
    double *zd = data_of(z);
    GUST_INDEPENDENT
    for (int64_t i = 0; i < n; ++i) {
        zd[i] = xd[i] / yd[i];
    }
}

static void scale(sunrealtype c, N_Vector x, N_Vector z)
{
    const int64_t n = lane_count(x);
    const gust_lanes *xd = lanes_of(x);
    gust_lanes *zd = lanes_of(z);
    if (c == 1.0) {
        /* No memcpy: choosing among its variants takes longer than a few registers. */
        for (int64_t i = 0; i < n; ++i) {
            zd[i] = xd[i];
        }
        return;
    }
    for (int64_t i = 0; i < n; ++i) {
        zd[i] = c * xd[i];
    }
}

static void absolute(N_Vector x, N_Vector z)
{
    const int64_t n = content(x)->padded;
    const double *xd = data_of(x);
    double *zd = data_of(z);
    GUST_INDEPENDENT
    for (int64_t i = 0; i < n; ++i) {
        zd[i] = fabs(xd[i]);
    }
}

static void inverse(N_Vector x, N_Vector z)
{
    const int64_t n = content(x)->length;
    const double *xd = data_of(x);
    double *zd = data_of(z);
    GUST_INDEPENDENT
    for (int64_t i = 0; i < n; ++i) {
        zd[i] = 1.0 / xd[i];
    }
}

static void add_constant(N_Vector x, sunrealtype b, N_Vector z)
{
    const int64_t n = content(x)->length;
    const double *xd = data_of(x);
    double *zd = data_of(z);
    GUST_INDEPENDENT
    for (int64_t i = 0; i < n; ++i) {
        zd[i] = xd[i] + b;
    }
}

static void compare(sunrealtype c, N_Vector x, N_Vector z)
{
    const int64_t n = content(x)->length;
    const double *xd = data_of(x);
    double *zd = data_of(z);
    for (int64_t i = 0; i < n; ++i) {
        zd[i] = fabs(xd[i]) >= c ? 1.0 : 0.0;
    }
}

/* Sums run in the lanes of one block that are added in a fixed order, so that they need not be reordered. */

static double dot_product(N_Vector x, N_Vector y)
{
    const int64_t n = lane_count(x);
    const gust_lanes *xd = lanes_of(x);
    const gust_lanes *yd = lanes_of(y);
    gust_lanes sum[GUST_BLOCK_LANES] = {{0.0}};
    for (int64_t i = 0; i < n; i += GUST_BLOCK_LANES) {
        for (int k = 0; k < GUST_BLOCK_LANES; ++k) {
            sum[k] += xd[i + k] * yd[i + k];
        }
    }
    return gust_lane_sum(sum);
}

static double weighted_square_sum(N_Vector x, N_Vector w)
{
    const int64_t n = lane_count(x);
    const gust_lanes *xd = lanes_of(x);
    const gust_lanes *wd = lanes_of(w);
    gust_lanes sum[GUST_BLOCK_LANES] = {{0.0}};
    for (int64_t i = 0; i < n; i += GUST_BLOCK_LANES) {
        for (int k = 0; k < GUST_BLOCK_LANES; ++k) {
            const gust_lanes term = xd[i + k] * wd[i + k];
            sum[k] += term * term;
        }
    }
    return gust_lane_sum(sum);
}

/* Only elements whose mask is positive count; all masks here are 0 or 1, so a factor does it. */
static double weighted_square_sum_mask(N_Vector x, N_Vector w, N_Vector id)
{
    const int64_t n = lane_count(x);
    const gust_lanes *xd = lanes_of(x);
    const gust_lanes *wd = lanes_of(w);
    const gust_lanes *md = lanes_of(id);
    gust_lanes sum[GUST_BLOCK_LANES] = {{0.0}};
    for (int64_t i = 0; i < n; i += GUST_BLOCK_LANES) {
        for (int k = 0; k < GUST_BLOCK_LANES; ++k) {
            const gust_lanes term = xd[i + k] * wd[i + k] * md[i + k];
            sum[k] += term * term;
        }
    }
    return gust_lane_sum(sum);
}

static double wrms_norm(N_Vector x, N_Vector w)
{
    return sqrt(weighted_square_sum(x, w) / (double)content(x)->length);
}

static double wrms_norm_mask(N_Vector x, N_Vector w, N_Vector id)
{
    return sqrt(weighted_square_sum_mask(x, w, id) / (double)content(x)->length);
}

static double wl2_norm(N_Vector x, N_Vector w)
{
    return sqrt(weighted_square_sum(x, w));
}

static double l1_norm(N_Vector x)
{
    const int64_t n = content(x)->length;
    const double *xd = data_of(x);
    double sum = 0.0;
    for (int64_t i = 0; i < n; ++i) {
        sum += fabs(xd[i]);
    }
    return sum;
}

static double max_norm(N_Vector x)
{
    const int64_t n = content(x)->padded;
    const double *xd = data_of(x);
    double largest = 0.0;
    for (int64_t i = 0; i < n; ++i) {
        const double size = fabs(xd[i]);
        largest = size > largest ? size : largest;
    }
    return largest;
}

static double minimum(N_Vector x)
{
    const int64_t n = content(x)->length;
    const double *xd = data_of(x);
    double smallest = xd[0];
    for (int64_t i = 1; i < n; ++i) {
        smallest = xd[i] < smallest ? xd[i] : smallest;
    }
    return smallest;
}

static sunbooleantype inverse_test(N_Vector x, N_Vector z)
{
    const int64_t n = content(x)->length;
    const double *xd = data_of(x);
    double *zd = data_of(z);
    sunbooleantype all = SUNTRUE;
    for (int64_t i = 0; i < n; ++i) {
        if (xd[i] == 0.0) {
            all = SUNFALSE;
        } else {
            zd[i] = 1.0 / xd[i];
        }
    }
    return all;
}

/* c = +-2: strictly of that sign, +-1: of that sign or 0, 0: free. m marks what is violated. */
static sunbooleantype constraint_mask(N_Vector c, N_Vector x, N_Vector m)
{
    const int64_t n = content(x)->length;
    const double *cd = data_of(c);
    const double *xd = data_of(x);
    double *md = data_of(m);
    sunbooleantype all = SUNTRUE;
    for (int64_t i = 0; i < n; ++i) {
        const double side = xd[i] * cd[i];
        const int violated = (fabs(cd[i]) > 1.5 && side <= 0.0) || (fabs(cd[i]) > 0.5 && side < 0.0);
        md[i] = violated ? 1.0 : 0.0;
        all = violated ? SUNFALSE : all;
    }
    return all;
}

static double minimum_quotient(N_Vector numerator, N_Vector denominator)
{
    const int64_t n = content(numerator)->length;
    const double *nd = data_of(numerator);
    const double *dd = data_of(denominator);
    double smallest = SUN_BIG_REAL;
    for (int64_t i = 0; i < n; ++i) {
        if (dd[i] != 0.0 && nd[i] / dd[i] < smallest) {
            smallest = nd[i] / dd[i];
        }
    }
    return smallest;
}

/* -- fused operations ----------------------------------------------------------------------------------- */

/* One loop for each number of vectors, so that everything stays in registers. Reading all inputs of an
 * element before writing it makes z = X[k] harmless. */
#define COMBINE(EXPRESSION)                                                                                    \
    for (int64_t i = 0; i < n; ++i) {                                                                          \
        zd[i] = EXPRESSION;                                                                                    \
    }

static int linear_combination(int count, sunrealtype *c, N_Vector *x, N_Vector z)
{
    const int64_t n = lane_count(z);
    gust_lanes *zd = lanes_of(z);
    const gust_lanes *v[MAX_FUSED];
    for (int k = 0; k < count && k < MAX_FUSED; ++k) {
        v[k] = lanes_of(x[k]);
    }
    switch (count) {
    case 1:
        scale(c[0], x[0], z);
        return 0;
    case 2:
        linear_sum(c[0], x[0], c[1], x[1], z);
        return 0;
    case 3: {
        const double c0 = c[0], c1 = c[1], c2 = c[2];
        COMBINE(c0 * v[0][i] + c1 * v[1][i] + c2 * v[2][i])
        return 0;
    }
    case 4: {
        const double c0 = c[0], c1 = c[1], c2 = c[2], c3 = c[3];
        COMBINE((c0 * v[0][i] + c1 * v[1][i]) + (c2 * v[2][i] + c3 * v[3][i]))
        return 0;
    }
    case 5: {
        const double c0 = c[0], c1 = c[1], c2 = c[2], c3 = c[3], c4 = c[4];
        COMBINE((c0 * v[0][i] + c1 * v[1][i]) + (c2 * v[2][i] + c3 * v[3][i]) + c4 * v[4][i])
        return 0;
    }
    case 6: {
        const double c0 = c[0], c1 = c[1], c2 = c[2], c3 = c[3], c4 = c[4], c5 = c[5];
        COMBINE((c0 * v[0][i] + c1 * v[1][i]) + (c2 * v[2][i] + c3 * v[3][i]) + (c4 * v[4][i] + c5 * v[5][i]))
        return 0;
    }
    case 7: {
        const double c0 = c[0], c1 = c[1], c2 = c[2], c3 = c[3], c4 = c[4], c5 = c[5], c6 = c[6];
        COMBINE((c0 * v[0][i] + c1 * v[1][i]) + (c2 * v[2][i] + c3 * v[3][i]) + (c4 * v[4][i] + c5 * v[5][i]) +
                c6 * v[6][i])
        return 0;
    }
    default:
        break;
    }
    if (count < 1) {
        return -1;
    }
    for (int64_t i = 0; i < n; ++i) {
        gust_lanes sum = {0.0};
        for (int k = 0; k < count; ++k) {
            sum += c[k] * lanes_of(x[k])[i];
        }
        zd[i] = sum;
    }
    return 0;
}

static int scale_add_multi(int count, sunrealtype *a, N_Vector x, N_Vector *y, N_Vector *z)
{
    for (int k = 0; k < count; ++k) {
        linear_sum(a[k], x, 1.0, y[k], z[k]);
    }
    return 0;
}

static int dot_product_multi(int count, N_Vector x, N_Vector *y, sunrealtype *products)
{
    for (int k = 0; k < count; ++k) {
        products[k] = dot_product(x, y[k]);
    }
    return 0;
}

static int linear_sum_array(int count, sunrealtype a, N_Vector *x, sunrealtype b, N_Vector *y, N_Vector *z)
{
    for (int k = 0; k < count; ++k) {
        linear_sum(a, x[k], b, y[k], z[k]);
    }
    return 0;
}

static int scale_array(int count, sunrealtype *c, N_Vector *x, N_Vector *z)
{
    for (int k = 0; k < count; ++k) {
        scale(c[k], x[k], z[k]);
    }
    return 0;
}

static int constant_array(int count, sunrealtype c, N_Vector *z)
{
    for (int k = 0; k < count; ++k) {
        set_constant(c, z[k]);
    }
    return 0;
}

static int wrms_norm_array(int count, N_Vector *x, N_Vector *w, sunrealtype *norm)
{
    for (int k = 0; k < count; ++k) {
        norm[k] = wrms_norm(x[k], w[k]);
    }
    return 0;
}

static int wrms_norm_mask_array(int count, N_Vector *x, N_Vector *w, N_Vector id, sunrealtype *norm)
{
    for (int k = 0; k < count; ++k) {
        norm[k] = wrms_norm_mask(x[k], w[k], id);
    }
    return 0;
}

/* -- constructor ---------------------------------------------------------------------------------------- */

static void fill_operations(N_Vector_Ops ops)
{
    ops->nvgetvectorid = get_id;
    ops->nvclone = clone;
    ops->nvcloneempty = clone_empty;
    ops->nvdestroy = destroy;
    ops->nvspace = space;
    ops->nvgetarraypointer = get_array;
    ops->nvgetlength = get_length;
    ops->nvlinearsum = linear_sum;
    ops->nvconst = set_constant;
    ops->nvprod = product;
    ops->nvdiv = divide;
    ops->nvscale = scale;
    ops->nvabs = absolute;
    ops->nvinv = inverse;
    ops->nvaddconst = add_constant;
    ops->nvdotprod = dot_product;
    ops->nvmaxnorm = max_norm;
    ops->nvwrmsnorm = wrms_norm;
    ops->nvwrmsnormmask = wrms_norm_mask;
    ops->nvmin = minimum;
    ops->nvwl2norm = wl2_norm;
    ops->nvl1norm = l1_norm;
    ops->nvcompare = compare;
    ops->nvinvtest = inverse_test;
    ops->nvconstrmask = constraint_mask;
    ops->nvminquotient = minimum_quotient;
    ops->nvlinearcombination = linear_combination;
    ops->nvscaleaddmulti = scale_add_multi;
    ops->nvdotprodmulti = dot_product_multi;
    ops->nvlinearsumvectorarray = linear_sum_array;
    ops->nvscalevectorarray = scale_array;
    ops->nvconstvectorarray = constant_array;
    ops->nvwrmsnormvectorarray = wrms_norm_array;
    ops->nvwrmsnormmaskvectorarray = wrms_norm_mask_array;
    ops->nvdotprodlocal = dot_product;
    ops->nvmaxnormlocal = max_norm;
    ops->nvminlocal = minimum;
    ops->nvl1normlocal = l1_norm;
    ops->nvinvtestlocal = inverse_test;
    ops->nvconstrmasklocal = constraint_mask;
    ops->nvminquotientlocal = minimum_quotient;
    ops->nvwsqrsumlocal = weighted_square_sum;
    ops->nvwsqrsummasklocal = weighted_square_sum_mask;
}

N_Vector gust_vector_new(int64_t length, SUNContext context)
{
    N_Vector made = N_VNewEmpty(context);
    if (made == NULL) {
        return NULL;
    }
    fill_operations(made->ops);
    gust_vector *inside = gust_allocate(1, sizeof *inside);
    if (inside == NULL) {
        N_VFreeEmpty(made);
        return NULL;
    }
    inside->length = length;
    inside->padded = gust_lane_padded(length);
    inside->data = gust_allocate((size_t)inside->padded, sizeof(double));
    made->content = inside;
    if (inside->data == NULL) {
        destroy(made);
        return NULL;
    }
    return made;
}
