// SPDX-License-Identifier: Apache-2.0
// Signatures of messages: keyed BLAKE2b (RFC 7693) by libb2, its authors' library. A signed type
// ends in its tag, and what is signed are all encoded bytes before it: the type's fingerprint is
// among them, so that no message passes for one of another type.
#ifndef RADIO_SEAL_H
#define RADIO_SEAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SEAL_KEY_BYTES 32
#define SEAL_TAG_BYTES 16
#define SEAL_ERROR_MAX 160

struct seal_key
{
    // false: nothing can be signed or believed.
    bool present;
    uint8_t bytes[SEAL_KEY_BYTES];
};

// Reads a key file: 64 hexadecimal digits, which nobody but its owner may read.
// @param error on failure one sentence. @return false if there is none; then the key is absent.
bool seal_load(const char *path, struct seal_key *key, char error[SEAL_ERROR_MAX]);

// Makes a key file with a new key if there is none. @return false and errno on failure.
bool seal_make(const char *path);

// The key of one robot, which says nothing of the operator's own nor of other robots'.
struct seal_key seal_derive(const struct seal_key *operator_key, int32_t robot_id);

// Writes the tag into the last bytes of a message; zero without a key.
void seal_sign(const struct seal_key *key, uint8_t *message, size_t size);

// @return true if the message was signed with this key.
bool seal_verify(const struct seal_key *key, const uint8_t *message, size_t size);

// Eight hexadecimal digits by which a key is told from another, and nothing else; "none" without
// one.
#define SEAL_NAME_MAX 9
void seal_name(const struct seal_key *key, char name[SEAL_NAME_MAX]);

// A number that nobody can guess, never 0.
int64_t seal_random(void);

#ifdef __cplusplus
}
#endif

#endif
