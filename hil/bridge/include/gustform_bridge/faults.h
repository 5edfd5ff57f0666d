/* States of the bridge and what leads to SAFE: one list, read by C, by the database and by the documents. */
#ifndef GUSTFORM_BRIDGE_FAULTS_H
#define GUSTFORM_BRIDGE_FAULTS_H

#ifdef __cplusplus
extern "C" {
#endif

typedef enum gust_state {
    GUST_STATE_INIT = 0, /* waiting for the converter's fingerprint, heartbeat and measurements */
    GUST_STATE_READY =
        1, /* all of them are good; commands are blocked, the controller stands at its start values */
    GUST_STATE_RUN = 2, /* commands are enabled */
    GUST_STATE_SAFE = 3 /* commands are blocked until an operator resets */
} gust_state;

/* Bit, name, sentence. */
#define GUST_FAULT_LIST(X)                                                                                     \
    X(0, TIMEOUT, "no new sample of the measurements for too many periods")                                    \
    X(1, COUNTER, "a counter jumped further than losses may explain")                                          \
    X(2, CRC, "CRC wrong for too many periods")                                                                \
    X(3, LENGTH, "length or kind of frame wrong for too many periods")                                         \
    X(4, MULTIPLEXER, "a multiplexer has a value that the database does not know")                             \
    X(5, NOT_FINITE, "a value is NaN or infinite under a good CRC")                                            \
    X(6, RANGE, "a value is outside of its range under a good CRC")                                            \
    X(7, PLAUSIBILITY, "a measurement changed faster than it can")                                             \
    X(8, STALE, "the measurements answer to a sample that is too old")                                         \
    X(9, MASQUERADE, "somebody else sends a frame that only this bridge may send")                             \
    X(10, BUS_OFF, "the CAN controller has left the bus, or the interface is down")                            \
    X(11, SEND, "a frame could not be sent, or did not leave within a period")                                 \
    X(12, FINGERPRINT, "the other side was built with another database")                                       \
    X(13, EMERGENCY_STOP, "emergency stop")                                                                    \
    X(14, CONVERTER, "the converter tripped or left its running state")                                        \
    X(15, CONTROLLER, "the controller gave an error signal")                                                   \
    X(16, DEADLINE, "a period was missed")                                                                     \
    X(17, WATCHDOG, "the loop did not serve the watchdog")                                                     \
    X(18, HEARTBEAT, "the converter's heartbeat stopped")

typedef enum gust_fault {
#define GUST_FAULT_BIT(bit, name, sentence) GUST_FAULT_##name = 1 << (bit),
    GUST_FAULT_LIST(GUST_FAULT_BIT) /* NOLINT(bugprone-signed-bitwise): enumerators are int */
#undef GUST_FAULT_BIT
} gust_fault;

#ifdef __cplusplus
}
#endif

#endif
