// SPDX-License-Identifier: Apache-2.0
#include "radio/seal.h"

#include <blake2.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#define HEX_DIGITS (2 * SEAL_KEY_BYTES)

static bool fail(char error[SEAL_ERROR_MAX], const char *path, const char *why)
{
    (void)snprintf(error, SEAL_ERROR_MAX, "key file '%.80s': %s", path, why);
    return false;
}

// -1 if it is none.
static int digit(char text)
{
    static const char digits[] = "0123456789abcdef";
    const char *found = text != '\0' ? strchr(digits, text) : NULL;
    return found != NULL ? (int)(found - digits) : -1;
}

static bool parse(const char *text, struct seal_key *key)
{
    for (size_t i = 0; i < SEAL_KEY_BYTES; ++i)
    {
        const int high = digit(text[2 * i]);
        const int low = high < 0 ? -1 : digit(text[2 * i + 1]);
        if (low < 0)
        {
            return false;
        }
        key->bytes[i] = (uint8_t)(16 * high + low);
    }
    return true;
}

bool seal_load(const char *path, struct seal_key *key, char error[SEAL_ERROR_MAX])
{
    *key = (struct seal_key){0};
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0)
    {
        return fail(error, path, strerror(errno));
    }
    struct stat about = {0};
    char text[HEX_DIGITS + 2] = {0};
    const bool known = fstat(fd, &about) == 0;
    const ssize_t got = read(fd, text, sizeof text - 1);
    (void)close(fd);
    if (!known || (about.st_mode & 077) != 0)
    {
        return fail(error, path, "others may read it: chmod 600, and make a new key");
    }
    if (got < HEX_DIGITS || (text[HEX_DIGITS] != '\0' && text[HEX_DIGITS] != '\n') ||
        !parse(text, key))
    {
        return fail(error, path, "is not 64 hexadecimal digits");
    }
    key->present = true;
    return true;
}

bool seal_make(const char *path)
{
    uint8_t bytes[SEAL_KEY_BYTES];
    char text[HEX_DIGITS + 2] = {0};
    const int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd < 0)
    {
        return errno == EEXIST;
    }
    bool ok = getrandom(bytes, sizeof bytes, 0) == sizeof bytes;
    for (size_t i = 0; i < sizeof bytes; ++i)
    {
        (void)snprintf(text + 2 * i, 3, "%02x", bytes[i]);
    }
    text[HEX_DIGITS] = '\n';
    ok = ok && write(fd, text, HEX_DIGITS + 1) == HEX_DIGITS + 1;
    ok = close(fd) == 0 && ok;
    if (!ok)
    {
        (void)unlink(path);
    }
    return ok;
}

static void hash(const struct seal_key *key, const void *bytes, size_t size, uint8_t *out,
                 size_t out_size)
{
    (void)blake2b(out, bytes, key->bytes, out_size, size, SEAL_KEY_BYTES);
}

struct seal_key seal_derive(const struct seal_key *operator_key, int32_t robot_id)
{
    char words[32];
    struct seal_key key = {.present = operator_key->present};
    const int size = snprintf(words, sizeof words, "twinmill robot %d", (int)robot_id);
    hash(operator_key, words, (size_t)size, key.bytes, sizeof key.bytes);
    return key;
}

void seal_sign(const struct seal_key *key, uint8_t *message, size_t size)
{
    uint8_t *tag = message + size - SEAL_TAG_BYTES;
    memset(tag, 0, SEAL_TAG_BYTES);
    if (key->present)
    {
        hash(key, message, size - SEAL_TAG_BYTES, tag, SEAL_TAG_BYTES);
    }
}

// Takes the same time wherever they differ, so that no tag can be guessed byte by byte.
static bool is_same(const uint8_t *a, const uint8_t *b, size_t size)
{
    volatile uint8_t different = 0;
    for (size_t i = 0; i < size; ++i)
    {
        different = (uint8_t)(different | (a[i] ^ b[i]));
    }
    return different == 0;
}

bool seal_verify(const struct seal_key *key, const uint8_t *message, size_t size)
{
    uint8_t tag[SEAL_TAG_BYTES];
    if (!key->present || size < SEAL_TAG_BYTES)
    {
        return false;
    }
    hash(key, message, size - SEAL_TAG_BYTES, tag, sizeof tag);
    return is_same(tag, message + size - SEAL_TAG_BYTES, sizeof tag);
}

void seal_name(const struct seal_key *key, char name[SEAL_NAME_MAX])
{
    static const char words[] = "twinmill key name";
    uint8_t bytes[SEAL_NAME_MAX / 2] = {0};
    hash(key, words, sizeof words - 1, bytes, sizeof bytes);
    (void)snprintf(name, SEAL_NAME_MAX, key->present ? "%02x%02x%02x%02x" : "none", bytes[0],
                   bytes[1], bytes[2], bytes[3]);
}

int64_t seal_random(void)
{
    int64_t number = 0;
    while (number == 0)
    {
        (void)!getrandom(&number, sizeof number, 0);
    }
    return number;
}
