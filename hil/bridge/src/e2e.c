#include "e2e.h"

/* Bit by bit: 48 bytes are 384 shifts, well below a microsecond, and there is no table to get wrong. */
static uint8_t crc8(uint8_t crc, uint8_t polynomial, const uint8_t *data, size_t length)
{
    for (size_t k = 0; k < length; k++) {
        crc ^= data[k];
        for (int bit = 0; bit < 8; bit++) {
            const uint8_t carry = (crc & 0x80U) != 0U ? polynomial : 0U;
            crc = (uint8_t)((uint8_t)(crc << 1) ^ carry);
        }
    }
    return crc;
}

uint8_t gust_crc8_j1850(uint8_t crc, const uint8_t *data, size_t length)
{
    return crc8(crc, 0x1DU, data, length);
}

uint8_t gust_crc8_h2f(uint8_t crc, const uint8_t *data, size_t length)
{
    return crc8(crc, 0x2FU, data, length);
}

uint16_t gust_crc16_ccitt(uint16_t crc, const uint8_t *data, size_t length)
{
    for (size_t k = 0; k < length; k++) {
        crc = (uint16_t)(crc ^ (uint16_t)(data[k] << 8));
        for (int bit = 0; bit < 8; bit++) {
            const uint16_t carry = (crc & 0x8000U) != 0U ? 0x1021U : 0U;
            crc = (uint16_t)((uint16_t)(crc << 1) ^ carry);
        }
    }
    return crc;
}

uint16_t gust_e2e_modulo(const gust_e2e *e2e)
{
    switch (e2e->profile) {
    case 1:
        return 15;
    case 2:
        return 16;
    case 5:
        return 256;
    default:
        return 1;
    }
}

static size_t header(const gust_e2e *e2e)
{
    switch (e2e->profile) {
    case 1:
    case 2:
        return 2;
    case 5:
        return 3;
    default:
        return 0;
    }
}

/* Profile 1: data id low, high, then the data; start value and XOR are 0, unlike those of the bare CRC. */
static uint8_t crc_profile_1(const gust_e2e *e2e, const uint8_t *data, size_t length)
{
    const uint8_t id[2] = {(uint8_t)(e2e->data_id & 0xFFU), (uint8_t)(e2e->data_id >> 8)};

    return gust_crc8_j1850(gust_crc8_j1850(0, id, 2), data + 1, length - 1);
}

/* Profile 2: the data, then the data id that belongs to the counter. */
static uint8_t crc_profile_2(const gust_e2e *e2e, const uint8_t *data, size_t length)
{
    const uint8_t crc = gust_crc8_h2f(0xFFU, data + 1, length - 1);

    return (uint8_t)(gust_crc8_h2f(crc, &e2e->list[data[1] & 0x0FU], 1) ^ 0xFFU);
}

/* Profile 5: the data, then data id low, high. */
static uint16_t crc_profile_5(const gust_e2e *e2e, const uint8_t *data, size_t length)
{
    const uint8_t id[2] = {(uint8_t)(e2e->data_id & 0xFFU), (uint8_t)(e2e->data_id >> 8)};

    return gust_crc16_ccitt(gust_crc16_ccitt(0xFFFFU, data + 2, length - 2), id, 2);
}

void gust_e2e_protect(const gust_e2e *e2e, uint8_t *data, size_t length, uint8_t counter)
{
    const uint8_t count = (uint8_t)(counter % gust_e2e_modulo(e2e));

    if (header(e2e) == 0 || length < header(e2e)) {
        return;
    }
    if (e2e->profile == 5) {
        data[2] = count;
        const uint16_t crc = crc_profile_5(e2e, data, length);
        data[0] = (uint8_t)(crc & 0xFFU);
        data[1] = (uint8_t)(crc >> 8);
        return;
    }
    data[1] = (uint8_t)((data[1] & 0xF0U) | count);
    data[0] = e2e->profile == 1 ? crc_profile_1(e2e, data, length) : crc_profile_2(e2e, data, length);
}

bool gust_e2e_good(const gust_e2e *e2e, const uint8_t *data, size_t length, uint8_t *counter)
{
    uint8_t count = 0;
    bool good = true;

    if (length < header(e2e)) {
        return false;
    }
    if (e2e->profile == 5) {
        count = data[2];
        good = ((uint32_t)data[0] | (uint32_t)data[1] << 8U) == crc_profile_5(e2e, data, length);
    } else if (e2e->profile == 1) {
        count = data[1] & 0x0FU;
        good = count < 15U && data[0] == crc_profile_1(e2e, data, length);
    } else if (e2e->profile == 2) {
        count = data[1] & 0x0FU;
        good = data[0] == crc_profile_2(e2e, data, length);
    }
    if (good) {
        *counter = count;
    }
    return good;
}
