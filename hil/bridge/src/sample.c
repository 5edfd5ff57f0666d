#include "gustform_bridge/sample.h"

#include <string.h>

#include "gustform_bridge/link.h"
#include "gustform_bridge/supervision.h"

bool gust_sample_init(gust_sample *sample, const gust_message_set *set, gust_part part)
{
    memset(sample, 0, sizeof *sample);
    const gust_message *message = gust_message_find(set, part, 0);
    while (message != NULL && sample->n < GUST_PIECES) {
        sample->piece[sample->n].message = message;
        const uint64_t modulus = gust_link_modulus(message, GUST_FIELD_SAMPLE);
        if (sample->modulus == 0 || (modulus != 0 && modulus < sample->modulus)) {
            sample->modulus = modulus;
        }
        ++sample->n;
        message = gust_message_find(set, part, (uint8_t)sample->n);
    }
    return message == NULL;
}

static bool all_here(const gust_sample *sample)
{
    for (uint32_t k = 0; k < sample->n; ++k) {
        if (!sample->piece[k].here) {
            return false;
        }
    }
    return true;
}

static void complete(gust_sample *sample, uint32_t number)
{
    sample->complete = true;
    sample->number = sample->modulus == 0 ? sample->number + 1U : number;
    for (uint32_t k = 0; k < sample->n; ++k) {
        gust_piece *piece = &sample->piece[k];
        memcpy(sample->values[k], piece->values, sizeof piece->values);
        piece->here = false;
        sample->lost = piece->lost > sample->lost ? piece->lost : sample->lost;
        piece->lost = 0;
    }
}

void gust_sample_add(gust_sample *sample, const gust_message *message, const double *values, uint32_t lost)
{
    if (message->piece >= sample->n) {
        return;
    }
    gust_piece *piece = &sample->piece[message->piece];
    piece->here = true;
    piece->lost += lost;
    piece->number = (uint32_t)gust_link_get(message, values, GUST_FIELD_SAMPLE, 0.0);
    memcpy(piece->values, values, message->n_signals * sizeof *values);
    for (uint32_t k = 0; k < sample->n; ++k) {
        gust_piece *other = &sample->piece[k];
        if (sample->modulus == 0 || !other->here || other->number == piece->number) {
            continue;
        }
        const bool older = gust_sample_difference(other->number, piece->number, sample->modulus) < 0;
        *(older ? &other->here : &piece->here) = false;
    }
    if (all_here(sample)) {
        complete(sample, piece->number);
    }
}

bool gust_sample_take(gust_sample *sample, uint32_t *lost)
{
    const bool taken = sample->complete;
    *lost = sample->lost;
    if (taken) {
        sample->lost = 0;
    }
    sample->complete = false;
    return taken;
}
