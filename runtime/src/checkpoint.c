/* Checkpoints: the state of a simulation as bytes and as a file, and back. */
#define _POSIX_C_SOURCE 200809L

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "memory.h"
#include "simulation.h"
#include "text.h"
#include "vector.h"

static const char MAGIC[8] = {'G', 'U', 'S', 'T', 'C', 'K', 'P', '1'};

/* -- what is in it -------------------------------------------------------------------------------------- */

/* What must be the same in the run that takes it up. */
static void archive_settings(gust_sim *sim, gust_archive *archive)
{
    for (int i = 0; gust_option_list(i) != NULL; ++i) {
        const char *name = gust_option_list(i)->name;
        gust_archive_same(archive, name, *gust_options_find(&sim->options, name, NULL));
    }
    gust_sink_archive_kind(&sim->sink, archive);
    gust_sink_archive_kind(&sim->probe, archive);
}

static void archive_state(gust_sim *sim, gust_archive *archive)
{
    gust_archive_doubles(archive, "reached", &sim->reached, 1);
    gust_archive_doubles(archive, "next_event", &sim->next_event, 1);
    gust_archive_flag(archive, "pending", &sim->pending);
    gust_archive_flag(archive, "root_found", &sim->root_found);
    gust_assembly_archive(&sim->system.assembly, archive);
    gust_series_archive(&sim->system.series, archive);
    gust_sampler_archive(&sim->sampler, archive);
    gust_controls_archive(&sim->controls, archive);
    gust_events_archive(&sim->events, archive);
    gust_solver_archive(&sim->solver, archive);
    gust_factors_archive(&sim->initial.factors, archive);
    gust_sink_archive(&sim->sink, archive);
    gust_sink_archive(&sim->probe, archive);
}

/* What setting up again counts too, and so is loaded after that. */
static void archive_counters(gust_sim *sim, gust_archive *archive)
{
    gust_archive_longs(archive, "cut_steps", &sim->cut_steps, 1);
    gust_archive_longs(archive, "residual_evaluations", &sim->system.residual_evaluations, 1);
    gust_archive_longs(archive, "jacobian_evaluations", &sim->system.jacobian_evaluations, 1);
    gust_archive_longs(archive, "root_evaluations", &sim->system.root_evaluations, 1);
    gust_archive_longs(archive, "initial_iterations", &sim->initial.iterations, 1);
    gust_factors_archive_counters(&sim->initial.factors, archive);
    gust_solver_archive_counters(&sim->solver, archive);
}

/* -- writing -------------------------------------------------------------------------------------------- */

gust_status gust_checkpoint_create(gust_sim *sim)
{
    gust_archive archive = {.mode = GUST_ARCHIVE_MEASURE, .good = true};
    archive_settings(sim, &archive);
    archive_state(sim, &archive);
    archive_counters(sim, &archive);
    sim->checkpoint_room = gust_archive_total(&archive);
    sim->checkpoint = gust_allocate(sim->checkpoint_room, 1);
    return sim->checkpoint != NULL ? GUST_OK : GUST_OUT_OF_MEMORY;
}

void gust_checkpoint_free(gust_sim *sim)
{
    gust_release(sim->checkpoint);
    sim->checkpoint = NULL;
}

/* The integrator starts anew at the time reached; if it is a step ahead, that step is given up. */
static gust_status stand_at_reached(gust_sim *sim)
{
    gust_solver *solver = &sim->solver;
    if (solver->t != sim->reached) {
        const size_t bytes = (size_t)sim->model->n_unknowns * sizeof(double);
        if (!gust_solver_dense(solver, sim->reached, true)) {
            gust_text(sim->message, sizeof sim->message, "no values at t = %.9g s", sim->reached);
            return GUST_SOLVER_FAILED;
        }
        memcpy(gust_vector_data(solver->y), gust_vector_data(solver->dense_y), bytes);
        memcpy(gust_vector_data(solver->yp), gust_vector_data(solver->dense_yp), bytes);
        solver->t = sim->reached;
        sim->pending = false;
        sim->root_found = false;
    }
    return gust_begin_anew(sim);
}

static bool write_all(int file, const uint8_t *bytes, size_t size)
{
    size_t done = 0;
    while (done < size) {
        const ssize_t put = write(file, bytes + done, size - done);
        if (put < 0 && errno == EINTR) {
            continue;
        }
        if (put <= 0) {
            errno = put == 0 ? EIO : errno;
            return false;
        }
        done += (size_t)put;
    }
    return fsync(file) == 0;
}

enum { LONGEST_PATH = 4096 };

/* The name of the file is made lasting too: a folder is a file of names. Where that is impossible the file is
 * there all the same. */
static void keep_name(const char *path)
{
    char folder[LONGEST_PATH];
    gust_text(folder, sizeof folder, "%s", path);
    char *slash = strrchr(folder, '/');
    if (slash == NULL) {
        gust_text(folder, sizeof folder, ".");
    } else {
        slash[slash == folder ? 1 : 0] = '\0';
    }
    const int handle = open(folder, O_RDONLY | O_CLOEXEC);
    if (handle >= 0) {
        fsync(handle);
        close(handle);
    }
}

static gust_status not_written(gust_sim *sim, const char *path, int reason)
{
    gust_text(sim->message, sizeof sim->message,
              "checkpoint \"%s\" at t = %.9g s could not be written: %s; the one before is still there", path,
              sim->reached, strerror(reason));
    return GUST_CHECKPOINT_FAILED;
}

static gust_status write_file(gust_sim *sim, const char *path)
{
    char part[LONGEST_PATH];
    const int length = snprintf(part, sizeof part, "%s.part", path);
    if (length < 0 || length >= (int)sizeof part) {
        return not_written(sim, path, ENAMETOOLONG);
    }
    const int file = open(part, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (file < 0) {
        return not_written(sim, path, errno);
    }
    int reason = write_all(file, sim->checkpoint, sim->checkpoint_size) ? 0 : errno;
    if (close(file) != 0 && reason == 0) {
        reason = errno;
    }
    if (reason == 0 && rename(part, path) != 0) {
        reason = errno;
    }
    if (reason != 0) {
        unlink(part);
        return not_written(sim, path, reason);
    }
    keep_name(path);
    return GUST_OK;
}

static gust_status only_ready(gust_sim *sim, const char *what)
{
    if (sim->phase == GUST_PHASE_READY) {
        return GUST_OK;
    }
    gust_text(sim->message, sizeof sim->message, "%s is possible after initialise and before the end only",
              what);
    return GUST_BAD_ORDER;
}

gust_status gust_sim_checkpoint(gust_sim *sim, const char *path)
{
    if (sim == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    gust_status status = only_ready(sim, "a checkpoint");
    if (status != GUST_OK) {
        return status;
    }
    status = stand_at_reached(sim);
    if (status != GUST_OK) {
        sim->phase = GUST_PHASE_ENDED;
        sim->ended_with = status;
        return status;
    }
    gust_archive archive;
    gust_archive_begin(&archive, sim->checkpoint, sim->checkpoint_room);
    archive_settings(sim, &archive);
    archive_state(sim, &archive);
    archive_counters(sim, &archive);
    gust_archive_seal(&archive, MAGIC, sim->model->identity);
    sim->checkpoint_size = archive.at;
    return path != NULL ? write_file(sim, path) : GUST_OK;
}

gust_status gust_sim_checkpoint_bytes(const gust_sim *sim, const void **bytes, size_t *size)
{
    if (sim == NULL || bytes == NULL || size == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    *bytes = sim->checkpoint;
    *size = sim->checkpoint_size;
    return sim->checkpoint_size > 0 ? GUST_OK : GUST_BAD_ORDER;
}

/* -- reading -------------------------------------------------------------------------------------------- */

static gust_status refuse(gust_sim *sim, gust_archive_fault fault)
{
    static const char *const WHY[] = {
        [GUST_ARCHIVE_NOT_ONE] = "it does not start with GUSTCKP1",
        [GUST_ARCHIVE_VERSION] = "it was written by another version of the runtime",
        [GUST_ARCHIVE_TORN] = "it is not as long as it says: it was cut off or added to",
        [GUST_ARCHIVE_DAMAGED] = "its checksum is wrong",
        [GUST_ARCHIVE_FOREIGN] = "it belongs to another model: the scenario or a component has changed since",
    };
    gust_text(sim->message, sizeof sim->message, "the checkpoint cannot be used: %s; start the run anew",
              WHY[fault]);
    return fault == GUST_ARCHIVE_FOREIGN ? GUST_FOREIGN_CHECKPOINT : GUST_BAD_CHECKPOINT;
}

static gust_status refuse_record(gust_sim *sim, const gust_archive *archive)
{
    if (archive->foreign) {
        gust_text(sim->message, sizeof sim->message,
                  "the checkpoint cannot be used: \"%s\" was another one in that run; set it as it was, or "
                  "start the run anew",
                  archive->wrong);
        return GUST_FOREIGN_CHECKPOINT;
    }
    gust_text(sim->message, sizeof sim->message,
              "the checkpoint cannot be used: record \"%s\" is not what it should be; start the run anew",
              archive->wrong);
    return GUST_BAD_CHECKPOINT;
}

static bool sound_state(const gust_sim *sim)
{
    const double *y = gust_vector_data(sim->solver.y);
    const double *yp = gust_vector_data(sim->solver.yp);
    bool finite = isfinite(sim->reached) && sim->reached == sim->solver.t && isfinite(sim->solver.first_step) &&
                  sim->solver.first_step > 0.0;
    for (int32_t i = 0; i < sim->model->n_unknowns; ++i) {
        finite = finite && isfinite(y[i]) && isfinite(yp[i]);
    }
    return finite;
}

/* From the loaded state to what follows from it. */
static gust_status set_up(gust_sim *sim)
{
    gust_solver *solver = &sim->solver;
    gust_assembly_prepare(&sim->system.assembly);
    if (!gust_series_reopen(&sim->system.series) ||
        !gust_events_settle(&sim->events, &sim->system, solver->t, gust_vector_data(solver->y),
                            gust_vector_data(solver->yp))) {
        gust_text(sim->message, sizeof sim->message, "%s", sim->system.series.message);
        return sim->system.series.failure;
    }
    if (!gust_factors_choose_again(&solver->factors) || !gust_factors_choose_again(&sim->initial.factors)) {
        gust_text(sim->message, sizeof sim->message,
                  "the checkpoint cannot be used: its Jacobian is singular; start the run anew");
        return GUST_BAD_CHECKPOINT;
    }
    return gust_solver_restart(solver, solver->t, solver->first_step, sim->message, sizeof sim->message);
}

static gust_status end_with(gust_sim *sim, gust_status status)
{
    sim->phase = GUST_PHASE_ENDED;
    sim->ended_with = status;
    gust_text_append(sim->message, sizeof sim->message, " (the simulation has no state any more)");
    return status;
}

gust_status gust_sim_restore_bytes(gust_sim *sim, const void *bytes, size_t size)
{
    if (sim == NULL || bytes == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    gust_status status = only_ready(sim, "going on from a checkpoint");
    if (status != GUST_OK) {
        return status;
    }
    gust_archive archive;
    const gust_archive_fault fault = gust_archive_open(&archive, bytes, size, MAGIC, sim->model->identity);
    if (fault != GUST_ARCHIVE_SOUND) {
        return refuse(sim, fault);
    }
    archive_settings(sim, &archive);
    if (!archive.good) {
        return refuse_record(sim, &archive);
    }
    archive_state(sim, &archive);
    if (!archive.good || !sound_state(sim)) {
        gust_archive_require(&archive, "solver.y", false);
        return end_with(sim, refuse_record(sim, &archive));
    }
    status = set_up(sim);
    if (status != GUST_OK) {
        return end_with(sim, status);
    }
    archive_counters(sim, &archive);
    if (!archive.good || archive.at != archive.size) {
        gust_archive_require(&archive, "end", false);
        return end_with(sim, refuse_record(sim, &archive));
    }
    atomic_store(&sim->time, sim->reached);
    return GUST_OK;
}

static gust_status not_read(gust_sim *sim, const char *path, const char *why)
{
    gust_text(sim->message, sizeof sim->message, "checkpoint \"%s\" cannot be read: %s", path, why);
    return GUST_CHECKPOINT_UNREADABLE;
}

gust_status gust_sim_restore(gust_sim *sim, const char *path)
{
    if (sim == NULL || path == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    const gust_status status = only_ready(sim, "going on from a checkpoint");
    if (status != GUST_OK) {
        return status;
    }
    const int file = open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0) {
        return not_read(sim, path, strerror(errno));
    }
    struct stat facts;
    if (fstat(file, &facts) != 0 || !S_ISREG(facts.st_mode)) {
        close(file);
        return not_read(sim, path, "it is not an ordinary file");
    }
    /* No checkpoint of this simulation is larger than its room. */
    size_t done = 0;
    sim->checkpoint_size = 0;
    while (done < sim->checkpoint_room) {
        const ssize_t got = read(file, sim->checkpoint + done, sim->checkpoint_room - done);
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got < 0) {
            const int reason = errno;
            close(file);
            return not_read(sim, path, strerror(reason));
        }
        if (got == 0) {
            break;
        }
        done += (size_t)got;
    }
    close(file);
    if ((uint64_t)facts.st_size > done && memcmp(sim->checkpoint, MAGIC, sizeof MAGIC) == 0) {
        return refuse(sim, GUST_ARCHIVE_FOREIGN);
    }
    return gust_sim_restore_bytes(sim, sim->checkpoint, done);
}
