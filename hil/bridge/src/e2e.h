/* End-to-end protection by the AUTOSAR E2E protocol specification: profiles 1 (data id in both bytes), 2 and 5.
 *
 * The header is first in the data: the CRC from byte 0 on, the counter in the lower half of byte 1 (profiles 1
 * and 2) or in byte 2 (profile 5). Profile 0 protects nothing. No function keeps a state or owns anything.
 */
#ifndef GUST_E2E_H
#define GUST_E2E_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gustform_bridge/messages.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What the counter counts modulo: 15, 16, 256; 1 for profile 0. */
uint16_t gust_e2e_modulo(const gust_e2e *e2e);

/* Write counter and CRC. A `length` too short for the header: nothing is written. */
void gust_e2e_protect(const gust_e2e *e2e, uint8_t *data, size_t length, uint8_t counter);

/* Whether the CRC is right and the counter one that the profile knows. `*counter` is written if so, 0 for
 * profile 0. */
bool gust_e2e_good(const gust_e2e *e2e, const uint8_t *data, size_t length, uint8_t *counter);

/* The CRCs by themselves, start value and final XOR left to the caller: CRC-8 SAE J1850 (polynomial 1D), CRC-8
 * H2F (2F), CRC-16/CCITT-FALSE (1021); most significant bit first. */
uint8_t gust_crc8_j1850(uint8_t crc, const uint8_t *data, size_t length);
uint8_t gust_crc8_h2f(uint8_t crc, const uint8_t *data, size_t length);
uint16_t gust_crc16_ccitt(uint16_t crc, const uint8_t *data, size_t length);

#ifdef __cplusplus
}
#endif

#endif
