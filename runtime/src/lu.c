#include "lu.h"

#include <math.h>
#include <string.h>

#include "lanes.h"
#include "memory.h"

/* -- plan ----------------------------------------------------------------------------------------------- */

static int32_t *integers(size_t count)
{
    return gust_allocate(count, sizeof(int32_t));
}

static bool allocate_pivots(gust_lu *lu, int32_t n, int32_t n_nonzeros)
{
    const size_t count = (size_t)n;
    lu->n = n;
    lu->row_of = integers(count);
    lu->column_of = integers(count);
    lu->a_start = integers(count + 1);
    lu->a_source = integers((size_t)n_nonzeros);
    lu->a_row = integers((size_t)n_nonzeros);
    lu->l_start = integers(count + 1);
    lu->u_start = integers(count + 1);
    lu->pivot = gust_allocate(count, sizeof(double));
    lu->pivot_inverse = gust_allocate(count, sizeof(double));
    lu->row_scale = gust_allocate(count, sizeof(double));
    lu->work = gust_allocate(count, sizeof(double));
    if (n <= GUST_LU_DENSE) {
        lu->padded = (int32_t)gust_lane_padded(n);
        lu->inverse = gust_allocate(count * (size_t)lu->padded, sizeof(double));
        if (lu->inverse == NULL) {
            return false;
        }
    }
    return lu->row_of != NULL && lu->column_of != NULL && lu->a_start != NULL && lu->a_source != NULL &&
           lu->a_row != NULL && lu->l_start != NULL && lu->u_start != NULL && lu->pivot != NULL &&
           lu->pivot_inverse != NULL && lu->row_scale != NULL && lu->work != NULL;
}

static bool allocate_factors(gust_lu *lu, int32_t n_lower, int32_t n_upper)
{
    lu->l_row = integers((size_t)n_lower);
    lu->l_column = integers((size_t)n_lower);
    lu->l_value = gust_allocate((size_t)n_lower, sizeof(double));
    lu->u_row = integers((size_t)n_upper);
    lu->u_column = integers((size_t)n_upper);
    lu->u_value = gust_allocate((size_t)n_upper, sizeof(double));
    return lu->l_row != NULL && lu->l_column != NULL && lu->l_value != NULL && lu->u_row != NULL &&
           lu->u_column != NULL && lu->u_value != NULL;
}

void gust_lu_free(gust_lu *lu)
{
    void *const blocks[] = {
        lu->row_of,       lu->column_of,  lu->a_start,       lu->a_source,    lu->a_row,        lu->l_start,
        lu->u_start,      lu->l_row,      lu->l_column,      lu->l_value,     lu->u_row,        lu->u_column,
        lu->u_value,      lu->pivot,      lu->pivot_inverse, lu->row_scale,   lu->work,         lu->inverse,
        lu->lower_source, lu->lower_row,  lu->lower_column,  lu->lower_value, lu->upper_source, lu->upper_row,
        lu->upper_column, lu->upper_value};
    for (size_t k = 0; k < sizeof blocks / sizeof blocks[0]; ++k) {
        gust_release(blocks[k]);
    }
    *lu = (gust_lu){0};
}

/* Which values of A go where, column by column in the order of pivots, and the size of each row. */
static void take_sources(gust_lu *lu, const int32_t *column_start, const int32_t *row_index,
                         const double *values, const int32_t *pivot_of_row)
{
    int32_t used = 0;
    for (int32_t k = 0; k < lu->n; ++k) {
        const int32_t column = lu->column_of[k];
        lu->a_start[k] = used;
        for (int32_t p = column_start[column]; p < column_start[column + 1]; ++p) {
            const int32_t pivot = pivot_of_row[row_index[p]];
            lu->a_source[used] = p;
            lu->a_row[used++] = pivot;
            lu->row_scale[pivot] = fmax(lu->row_scale[pivot], fabs(values[p]));
        }
    }
    lu->a_start[lu->n] = used;
    for (int32_t k = 0; k < lu->n; ++k) {
        lu->row_scale[k] = lu->row_scale[k] > 0.0 ? 1.0 / lu->row_scale[k] : 1.0;
    }
}

enum { FIRST_ROOM = 1024 };

/* Lists that grow while the pattern of the factors is being found. */
typedef struct growing {
    int32_t *entry;
    int32_t used;
    int32_t room;
} growing;

static bool append(growing *list, int32_t entry)
{
    if (list->used == list->room) {
        const int32_t room = list->room + list->room / 2;
        int32_t *larger = room > list->room ? integers((size_t)room) : NULL;
        if (larger == NULL) {
            return false;
        }
        memcpy(larger, list->entry, (size_t)list->used * sizeof *larger);
        gust_release(list->entry);
        list->entry = larger;
        list->room = room;
    }
    list->entry[list->used++] = entry;
    return true;
}

/* The pattern of one column of the factors: the rows of A, and those that eliminating them fills in. Rows
 * above the diagonal wait in a heap, so that they are met in ascending order without looking at all of them. */
typedef struct column_search {
    int32_t *mark; /* [n] last column that met this row, + 1 */
    int32_t *heap; /* rows still to be eliminated, smallest first */
    int32_t n_heap;
} column_search;

static void push(column_search *search, int32_t row)
{
    int32_t at = search->n_heap++;
    while (at > 0 && search->heap[(at - 1) / 2] > row) {
        search->heap[at] = search->heap[(at - 1) / 2];
        at = (at - 1) / 2;
    }
    search->heap[at] = row;
}

static int32_t pop(column_search *search)
{
    const int32_t smallest = search->heap[0];
    const int32_t last = search->heap[--search->n_heap];
    int32_t at = 0;
    for (;;) {
        int32_t child = 2 * at + 1;
        if (child >= search->n_heap) {
            break;
        }
        if (child + 1 < search->n_heap && search->heap[child + 1] < search->heap[child]) {
            ++child;
        }
        if (search->heap[child] >= last) {
            break;
        }
        search->heap[at] = search->heap[child];
        at = child;
    }
    search->heap[at] = last;
    return smallest;
}

static bool meet(column_search *search, int32_t row, int32_t k, growing *lower)
{
    if (search->mark[row] == k + 1) {
        return true;
    }
    search->mark[row] = k + 1;
    if (row < k) {
        push(search, row);
        return true;
    }
    return row == k || append(lower, row);
}

static bool find_column(const gust_lu *lu, int32_t k, column_search *search, growing *lower, growing *upper)
{
    bool good = true;
    search->n_heap = 0;
    for (int32_t p = lu->a_start[k]; p < lu->a_start[k + 1] && good; ++p) {
        good = meet(search, lu->a_row[p], k, lower);
    }
    while (search->n_heap > 0 && good) {
        const int32_t j = pop(search);
        good = append(upper, j);
        for (int32_t p = lu->l_start[j]; p < lu->l_start[j + 1] && good; ++p) {
            good = meet(search, lower->entry[p], k, lower);
        }
    }
    return good;
}

/* Moves the pattern found into the arrays a solve runs through. */
static void arrange(gust_lu *lu, const growing *lower, const growing *upper, const int32_t *upper_start)
{
    const int32_t n = lu->n;
    for (int32_t k = 0; k < n; ++k) {
        for (int32_t p = lu->l_start[k]; p < lu->l_start[k + 1]; ++p) {
            lu->l_row[p] = lower->entry[p];
            lu->l_column[p] = k;
        }
    }
    lu->u_start[n] = 0;
    for (int32_t k = n - 1; k >= 0; --k) {
        int32_t used = lu->u_start[k + 1];
        for (int32_t p = upper_start[k + 1] - 1; p >= upper_start[k]; --p) {
            lu->u_row[used] = upper->entry[p];
            lu->u_column[used++] = k;
        }
        lu->u_start[k] = used;
    }
}

static bool find_pattern(gust_lu *lu)
{
    const int32_t n = lu->n;
    growing lower = {.entry = integers(FIRST_ROOM), .room = FIRST_ROOM};
    growing upper = {.entry = integers(FIRST_ROOM), .room = FIRST_ROOM};
    column_search search = {.mark = integers((size_t)n), .heap = integers((size_t)n)};
    int32_t *upper_start = integers((size_t)n + 1);
    bool good = lower.entry != NULL && upper.entry != NULL && search.mark != NULL && search.heap != NULL &&
                upper_start != NULL;
    for (int32_t k = 0; k < n && good; ++k) {
        lu->l_start[k] = lower.used;
        upper_start[k] = upper.used;
        good = find_column(lu, k, &search, &lower, &upper);
        lu->l_start[k + 1] = lower.used;
        upper_start[k + 1] = upper.used;
    }
    good = good && allocate_factors(lu, lower.used, upper.used);
    if (good) {
        arrange(lu, &lower, &upper, upper_start);
    }
    gust_release(search.mark);
    gust_release(search.heap);
    gust_release(upper_start);
    gust_release(lower.entry);
    gust_release(upper.entry);
    return good;
}

/* -- order of the entries in a solve -------------------------------------------------------------------- */

enum {
    CHUNK = 256
}; /* columns among which entries change their order: x of a chunk fits in the nearest cache */

/* One triangular factor on its way into solving order. */
typedef struct ordering {
    const int32_t *start; /* of the entries of a column */
    const int32_t *end;
    const int32_t *row;
    int32_t *source; /* result */
    int32_t *target_row;
    int32_t *target_column;
    int32_t *level; /* [n] how many columns of its chunk must be used one after the other before this one */
    int32_t used;
} ordering;

/* Columns first, first + step, ... of one chunk, in the order of a solve. */
static void order_chunk(ordering *order, int32_t first, int32_t step, int32_t count)
{
    int32_t deepest = 0;
    for (int32_t i = 0, k = first; i < count; ++i, k += step) {
        for (int32_t p = order->start[k]; p < order->end[k]; ++p) {
            const int32_t row = order->row[p];
            if (order->level[row] <= order->level[k]) {
                order->level[row] = order->level[k] + 1;
            }
        }
        deepest = order->level[k] > deepest ? order->level[k] : deepest;
    }
    for (int32_t level = 0; level <= deepest; ++level) {
        for (int32_t i = 0, k = first; i < count; ++i, k += step) {
            for (int32_t p = order->start[k]; order->level[k] == level && p < order->end[k]; ++p) {
                order->source[order->used] = p;
                order->target_row[order->used] = order->row[p];
                order->target_column[order->used++] = k;
            }
        }
    }
}

static void order_lower(gust_lu *lu, int32_t *level)
{
    ordering order = {lu->l_start,   lu->l_start + 1,  lu->l_row, lu->lower_source,
                      lu->lower_row, lu->lower_column, level,     0};
    for (int32_t first = 0; first < lu->n; first += CHUNK) {
        memset(level, 0, (size_t)lu->n * sizeof *level);
        order_chunk(&order, first, 1, lu->n - first < CHUNK ? lu->n - first : CHUNK);
    }
}

static void order_upper(gust_lu *lu, int32_t *level)
{
    ordering order = {lu->u_start + 1, lu->u_start,      lu->u_row, lu->upper_source,
                      lu->upper_row,   lu->upper_column, level,     0};
    for (int32_t last = lu->n - 1; last >= 0; last -= CHUNK) {
        memset(level, 0, (size_t)lu->n * sizeof *level);
        order_chunk(&order, last, -1, last + 1 < CHUNK ? last + 1 : CHUNK);
    }
}

static bool order_entries(gust_lu *lu)
{
    const size_t n_lower = (size_t)lu->l_start[lu->n];
    const size_t n_upper = (size_t)lu->u_start[0];
    int32_t *level = integers((size_t)lu->n);
    lu->lower_source = integers(n_lower);
    lu->lower_row = integers(n_lower);
    lu->lower_column = integers(n_lower);
    lu->lower_value = gust_allocate(n_lower, sizeof(double));
    lu->upper_source = integers(n_upper);
    lu->upper_row = integers(n_upper);
    lu->upper_column = integers(n_upper);
    lu->upper_value = gust_allocate(n_upper, sizeof(double));
    const bool good = level != NULL && lu->lower_source != NULL && lu->lower_row != NULL &&
                      lu->lower_column != NULL && lu->lower_value != NULL && lu->upper_source != NULL &&
                      lu->upper_row != NULL && lu->upper_column != NULL && lu->upper_value != NULL;
    if (good) {
        order_lower(lu, level);
        order_upper(lu, level);
    }
    gust_release(level);
    return good;
}

bool gust_lu_plan(gust_lu *lu, const int32_t *column_start, const int32_t *row_index, const double *values,
                  klu_symbolic *symbolic, klu_numeric *numeric, klu_common *common)
{
    gust_lu_free(lu);
    const int32_t n = numeric->n;
    int32_t *pivot_of_row = integers((size_t)n);
    bool good = pivot_of_row != NULL && allocate_pivots(lu, n, column_start[n]);
    good = good && klu_extract(numeric, symbolic, NULL, NULL, NULL, NULL, NULL, NULL, NULL, NULL, NULL,
                               lu->row_of, lu->column_of, NULL, NULL, common) == 1;
    if (good) {
        for (int32_t k = 0; k < n; ++k) {
            pivot_of_row[lu->row_of[k]] = k;
        }
        take_sources(lu, column_start, row_index, values, pivot_of_row);
        good = find_pattern(lu) && (lu->inverse != NULL || order_entries(lu));
    }
    gust_release(pivot_of_row);
    if (!good) {
        gust_lu_free(lu);
    }
    return good;
}

/* -- numbers -------------------------------------------------------------------------------------------- */

bool gust_lu_factor(gust_lu *lu, const double *values)
{
    const int32_t n = lu->n;
    const int32_t *restrict a_row = lu->a_row;
    const int32_t *restrict a_source = lu->a_source;
    const int32_t *restrict l_start = lu->l_start;
    const int32_t *restrict l_row = lu->l_row;
    const int32_t *restrict u_row = lu->u_row;
    double *restrict l_value = lu->l_value;
    double *restrict u_value = lu->u_value;
    double *restrict work = lu->work;
    lu->solves = 0;
    lu->inverted = false;
    for (int32_t k = 0; k < n; ++k) {
        for (int32_t p = lu->a_start[k]; p < lu->a_start[k + 1]; ++p) {
            work[a_row[p]] = values[a_source[p]];
        }
        /* Rows ascending: from the end of the column's entries, see gust_lu. */
        for (int32_t u = lu->u_start[k] - 1; u >= lu->u_start[k + 1]; --u) {
            const int32_t j = u_row[u];
            const double factor = work[j];
            work[j] = 0.0;
            u_value[u] = factor * lu->pivot_inverse[j];
            for (int32_t p = l_start[j]; p < l_start[j + 1]; ++p) {
                work[l_row[p]] -= l_value[p] * factor;
            }
        }
        const double pivot = work[k];
        const double inverse = 1.0 / pivot;
        work[k] = 0.0;
        if (!(fabs(inverse) <= 1e300)) { /* also NaN */
            lu->singular_pivot = k;
            memset(work, 0, (size_t)n * sizeof *work);
            return false;
        }
        lu->pivot[k] = pivot;
        lu->pivot_inverse[k] = inverse;
        for (int32_t p = l_start[k]; p < l_start[k + 1]; ++p) {
            l_value[p] = work[l_row[p]] * inverse;
            work[l_row[p]] = 0.0;
        }
    }
    if (lu->inverse == NULL) {
        for (int32_t e = 0; e < l_start[n]; ++e) {
            lu->lower_value[e] = l_value[lu->lower_source[e]];
        }
        for (int32_t e = 0; e < lu->u_start[0]; ++e) {
            lu->upper_value[e] = u_value[lu->upper_source[e]];
        }
    }
    return true;
}

double gust_lu_growth(const gust_lu *lu, const double *values)
{
    double smallest = 1.0;
    for (int32_t k = 0; k < lu->n; ++k) {
        double largest_a = 0.0;
        for (int32_t p = lu->a_start[k]; p < lu->a_start[k + 1]; ++p) {
            largest_a = fmax(largest_a, fabs(values[lu->a_source[p]]) * lu->row_scale[lu->a_row[p]]);
        }
        double largest_u = fabs(lu->pivot[k]) * lu->row_scale[k];
        for (int32_t u = lu->u_start[k + 1]; u < lu->u_start[k]; ++u) {
            const int32_t j = lu->u_row[u];
            largest_u = fmax(largest_u, fabs(lu->u_value[u] * lu->pivot[j]) * lu->row_scale[j]);
        }
        smallest = largest_u > 0.0 ? fmin(smallest, largest_a / largest_u) : 0.0;
    }
    return smallest;
}

static inline void subtract(gust_lanes *target, double factor, const gust_lanes *source, int32_t n_lanes)
{
    for (int32_t v = 0; v < n_lanes; ++v) {
        target[v] -= factor * source[v];
    }
}

/* The columns of A^-1 are the rows of A^-T: A^T z = Q U^T D L^T P z = e is solved for all unit vectors e at
 * once, element by element of z, so that each operation is one on a whole row. */
static void invert(gust_lu *lu)
{
    const int32_t n = lu->n;
    const int32_t n_lanes = lu->padded / GUST_LANES;
    gust_lanes *rows = gust_lanes_of(lu->inverse);
    memset(lu->inverse, 0, (size_t)n * (size_t)lu->padded * sizeof(double));
    for (int32_t k = 0; k < n; ++k) {
        lu->inverse[(int64_t)lu->row_of[k] * lu->padded + lu->column_of[k]] = 1.0;
    }
    for (int32_t e = lu->u_start[0] - 1; e >= 0; --e) {
        subtract(rows + (int64_t)lu->row_of[lu->u_column[e]] * n_lanes, lu->u_value[e],
                 rows + (int64_t)lu->row_of[lu->u_row[e]] * n_lanes, n_lanes);
    }
    for (int32_t k = 0; k < n; ++k) {
        gust_lanes *row = rows + (int64_t)lu->row_of[k] * n_lanes;
        for (int32_t v = 0; v < n_lanes; ++v) {
            row[v] *= lu->pivot_inverse[k];
        }
    }
    for (int32_t e = lu->l_start[n] - 1; e >= 0; --e) {
        subtract(rows + (int64_t)lu->row_of[lu->l_column[e]] * n_lanes, lu->l_value[e],
                 rows + (int64_t)lu->row_of[lu->l_row[e]] * n_lanes, n_lanes);
    }
    lu->inverted = true;
}

/* Registers that the sums below may take, in two sets. */
#if defined(__AVX512F__)
enum { MOST_SUMS = 8 };
#else
enum { MOST_SUMS = 6 };
#endif

/* `n_sums` lanes of the sum of columns, all in registers. Columns are `stride` lanes apart. */
__attribute__((always_inline)) static inline void add_columns(const gust_lanes *column, int64_t stride,
                                                              int32_t n, const double *right, double *solution,
                                                              const int n_sums)
{
    /* Two sums, so that an addition need not wait for the one before it. */
    gust_lanes even[MOST_SUMS];
    gust_lanes odd[MOST_SUMS];
    for (int v = 0; v < n_sums; ++v) {
        even[v] = (gust_lanes){0.0};
        odd[v] = (gust_lanes){0.0};
    }
    int32_t k = 0;
    for (; k + 1 < n; k += 2, column += 2 * stride) {
        for (int v = 0; v < n_sums; ++v) {
            even[v] += column[v] * right[k];
            odd[v] += column[stride + v] * right[k + 1];
        }
    }
    if (k < n) {
        for (int v = 0; v < n_sums; ++v) {
            even[v] += column[v] * right[k];
        }
    }
    for (int v = 0; v < n_sums; ++v) {
        even[v] += odd[v];
        memcpy(solution + (int64_t)v * GUST_LANES, &even[v], sizeof even[v]); /* on any address */
    }
}

static void apply_inverse(const gust_lu *lu, const double *right, double *solution)
{
    const int64_t n_lanes = lu->padded / GUST_LANES;
    const gust_lanes *columns = gust_lanes_in(lu->inverse);
    /* `right` may be the same array as `solution`: what is read again after a part of that is written is kept.
     */
    double kept[GUST_LU_DENSE];
    if (n_lanes > MOST_SUMS) {
        memcpy(kept, right, (size_t)lu->n * sizeof *right);
        right = kept;
    }
    int64_t v = 0;
    while (v < n_lanes) {
        const int64_t left = n_lanes - v;
        const int64_t n_sums = left < MOST_SUMS ? left : MOST_SUMS;
        switch (n_sums) {
#define ADD_COLUMNS(N) add_columns(columns + v, n_lanes, lu->n, right, solution + v * GUST_LANES, N)
        case 1:
            ADD_COLUMNS(1);
            break;
        case 2:
            ADD_COLUMNS(2);
            break;
        case 3:
            ADD_COLUMNS(3);
            break;
        case 4:
            ADD_COLUMNS(4);
            break;
        case 5:
            ADD_COLUMNS(5);
            break;
#if defined(__AVX512F__)
        case 6:
            ADD_COLUMNS(6);
            break;
        case 7:
            ADD_COLUMNS(7);
            break;
#endif
        default:
            ADD_COLUMNS(MOST_SUMS);
            break;
#undef ADD_COLUMNS
        }
        v += n_sums;
    }
}

/* One loop over all entries instead of one for each column: columns are so short that the loops themselves
 * would take longer than what is in them. */
static inline void eliminate(double *x, const int32_t *row, const int32_t *column, const double *value,
                             int32_t count)
{
    for (int32_t e = 0; e < count; ++e) {
        x[row[e]] -= value[e] * x[column[e]];
    }
}

static void solve_triangular(const gust_lu *lu, const double *right, double *solution)
{
    const int32_t n = lu->n;
    const bool small = lu->inverse != NULL;
    double *restrict x = lu->work;
    for (int32_t k = 0; k < n; ++k) {
        x[k] = right[lu->row_of[k]];
    }
    eliminate(x, small ? lu->l_row : lu->lower_row, small ? lu->l_column : lu->lower_column,
              small ? lu->l_value : lu->lower_value, lu->l_start[n]);
    for (int32_t k = 0; k < n; ++k) {
        x[k] *= lu->pivot_inverse[k];
    }
    eliminate(x, small ? lu->u_row : lu->upper_row, small ? lu->u_column : lu->upper_column,
              small ? lu->u_value : lu->upper_value, lu->u_start[0]);
    for (int32_t k = 0; k < n; ++k) {
        solution[lu->column_of[k]] = x[k];
        x[k] = 0.0;
    }
}

void gust_lu_solve(gust_lu *lu, const double *right, double *solution)
{
    if (lu->inverse == NULL) {
        solve_triangular(lu, right, solution);
        return;
    }
    if (!lu->inverted && ++lu->solves > GUST_LU_PATIENCE) {
        invert(lu);
    }
    if (lu->inverted) {
        apply_inverse(lu, right, solution);
    } else {
        solve_triangular(lu, right, solution);
    }
}
