/* Two message sets of the tests' own: one message a part, and measurements and references in two pieces. */
#ifndef GUST_TEST_DATABASE_H
#define GUST_TEST_DATABASE_H

#include "gustform_bridge/messages.h"

extern const gust_message_set test_database;
extern const gust_message_set test_pieces;

/* References without beta_ref; and neither heartbeats, fingerprints nor Sync. */
extern const gust_message_set test_lacking;
extern const gust_message_set test_bare;

#endif
