/* What a loaded model consists of. Read-only after gust_model_parse; arrays point into `bytes`. */
#ifndef GUSTFORM_MODEL_H
#define GUSTFORM_MODEL_H

#include <stdint.h>

#include "gustform/gust_controller.h"
#include "gustform/gust_kernel.h"
#include "gustform/gust_model.h"

/* Kinds of root function, `type.T.root_kind`. */
enum { GUST_ROOT_KINK = 0, GUST_ROOT_WHEN = 1 };

/* Kinds of channel, first number of each in `channel`. */
enum { GUST_CHANNEL_UNKNOWN = 0, GUST_CHANNEL_OUTPUT = 1 };

/* Fields of `series.S.kind`. */
enum { GUST_SERIES_LINEAR = 0, GUST_SERIES_HOLD = 1, GUST_SERIES_PCHIP = 2 };
enum { GUST_SERIES_INLINE = 0, GUST_SERIES_READER = 1, GUST_SERIES_FILE = 2 };
enum { GUST_SERIES_END_ERROR = 0, GUST_SERIES_END_HOLD = 1, GUST_SERIES_END_REPEAT = 2 };

/* One unit type with all its instances. Per-instance arrays are stored instance by instance. */
typedef struct gust_model_type {
    const char *name;
    const char *kernel_path; /* as the table has it */
    void *library;           /* from dlopen; NULL if none */
    const gust_kernel *kernel;
    int32_t n_instances;
    const char **instance_name;  /* [n_instances] */
    const char **unknown_name;   /* [n_unknowns] */
    const char **equation_name;  /* [n_unknowns] */
    const char **external_name;  /* [n_external] */
    const char **flow_name;      /* [n_flows] */
    const char **root_name;      /* [n_roots] */
    const char **when_name;      /* [n_whens] */
    const char **parameter_name; /* [n_parameters] */
    const int32_t *first_unknown;
    const int32_t *external;          /* global unknown of each shared one */
    const int32_t *flow_row;          /* global row of each flow */
    const int32_t *jacobian_position; /* where in the CSC values each local entry is added */
    const int32_t *first_input;
    const int32_t *table;
    const double *parameters;
    const double *discrete;
    const uint8_t *root_kind;
    const int32_t *when_root;
    const int32_t *when_period;
} gust_model_type;

typedef struct gust_model_series {
    const char *name;
    const char *unit;
    int32_t interpolation;
    int32_t source;
    int32_t on_end;
    int32_t uniform;
    int64_t n_slots;
    const int32_t *slots;
    double t0;         /* time of the first sample, s (uniform) */
    double dt;         /* s, uniform only */
    double t_end;      /* last time with data, s; infinite if endless */
    int64_t n_samples; /* inline only */
    const double *time;
    const double *value;
    const char *path; /* file source: complete path */
} gust_model_series;

typedef struct gust_schedule_entry {
    double time;
    int32_t type;
    int32_t instance;
    int32_t parameter;
    double value;
} gust_schedule_entry;

typedef struct gust_channel {
    int32_t kind;
    int32_t a; /* unknown, or instance counted through all types */
    int32_t b; /* output of that instance */
    const char *name;
    const char *unit;
} gust_channel;

/* A shared library with an exported controller; instances of it differ by their contexts alone. */
typedef struct gust_model_library {
    const char *path; /* as the table has it */
    void *library;    /* from dlopen */
    const gust_controller *controller;
} gust_model_library;

/* A value that a sampled block measures. */
typedef struct gust_measurement {
    int32_t kind; /* as of a channel */
    int32_t a;    /* unknown; or output ... */
    int32_t sign; /* +-1 */
} gust_measurement;

/* A controller beside the equations of one instance: it measures there and holds discrete values there. */
typedef struct gust_model_sampled {
    gust_sampled_info info;
    int32_t type;
    int32_t instance;
    int32_t library; /* -1: the host steps it */
    int32_t n_states;
    int64_t n_parameters;
    gust_measurement *measurement; /* [info.n_measurements] */
    const int32_t *command;        /* [info.n_commands] discrete values of the instance */
    const int32_t *monitor;        /* [n_monitors] others, for what the controller tells of itself */
    int32_t n_monitors;
    const double *parameters; /* of the controller at the start */
    const double *states;     /* of the controller at the start, one after the other from state_offset on */
    uint32_t state_offset;    /* in the context, bytes */
} gust_model_sampled;

/* A parameter of a sampled block's controller gets another value. */
typedef struct gust_sampled_change {
    double time;
    int32_t block;
    int32_t parameter;
    double value;
} gust_sampled_change;

struct gust_model {
    uint8_t *bytes;    /* the whole container */
    uint64_t identity; /* hash of everything that a run depends on */
    int32_t n_unknowns;
    int32_t n_nonzeros;
    int32_t n_types;
    int32_t n_inputs;
    int32_t n_series;
    int32_t n_tables;
    int32_t n_schedule;
    int32_t n_channels;
    int32_t n_instances; /* of all types */
    const int32_t *column_start;
    const int32_t *row_index;
    const double *start;
    const double *start_derivative;
    const double *nominal;
    const uint8_t *differential;
    const double *input_value;
    gust_model_type *types;
    gust_model_series *series;
    gust_table *tables;
    gust_schedule_entry *schedule;
    gust_channel *channels;
    int32_t n_libraries;
    int32_t n_sampled;
    int32_t n_sampled_changes;
    gust_model_library *libraries;
    gust_model_sampled *sampled;
    double *sampled_starts; /* commands of all blocks before their first samples */
    gust_sampled_change *sampled_changes;
    int32_t n_unowned; /* unknowns and rows that belong to no instance: shared potentials and flow sums */
    int32_t *unowned;
    const char *metadata;
    char **text_tables; /* the blocks behind the name arrays, to be freed */
    int64_t n_text_tables;
    char **paths; /* completed paths of series files, to be freed */
};

#endif
