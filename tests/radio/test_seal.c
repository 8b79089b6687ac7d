// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/radio/seal.c. Where a number is expected it is Python's hashlib's, another
// implementation of BLAKE2b: the operator's tools sign with that one.
#include "radio/seal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "unity.h"

// Fixture

static char folder[] = "/tmp/test_seal.XXXXXX";
static char path[64];
static char error[SEAL_ERROR_MAX];
static struct seal_key key;

static const char counting[] = "000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f";

void setUp(void)
{
    (void)snprintf(path, sizeof path, "%s/key", folder);
}

void tearDown(void)
{
    (void)unlink(path);
}

static void write_key(const char *text, mode_t mode)
{
    FILE *file = fopen(path, "w");
    TEST_ASSERT_NOT_NULL(file);
    (void)fputs(text, file);
    (void)fclose(file);
    TEST_ASSERT_EQUAL(0, chmod(path, mode));
}

static bool load(const char *text, mode_t mode)
{
    write_key(text, mode);
    const bool ok = seal_load(path, &key, error);
    TEST_ASSERT_EQUAL(ok, key.present);
    return ok;
}

// Test

static void test_signature_is_that_of_another_implementation(void)
{
    static const uint8_t robot_3[SEAL_KEY_BYTES] = {0x10, 0x8d, 0x07, 0xd3, 0x80, 0x5c, 0x52, 0x35,
                                                    0x7f, 0x68, 0x82, 0x98, 0x6b, 0xe2, 0xbd, 0xa6,
                                                    0x72, 0xf8, 0xf8, 0x2c, 0xdf, 0x9f, 0x89, 0x02,
                                                    0xd3, 0xb5, 0xa1, 0x11, 0xb2, 0x80, 0x6f, 0x21};
    static const uint8_t hello_tag[SEAL_TAG_BYTES] = {0xda, 0x08, 0x3a, 0xa5, 0xfd, 0x01,
                                                      0x17, 0x81, 0x56, 0x15, 0xcd, 0x7b,
                                                      0x58, 0x93, 0x79, 0xd1};
    TEST_ASSERT_TRUE(load(counting, 0600));
    const struct seal_key robot = seal_derive(&key, 3);
    TEST_ASSERT_TRUE(robot.present);
    TEST_ASSERT_EQUAL_MEMORY(robot_3, robot.bytes, sizeof robot_3);
    uint8_t message[5 + SEAL_TAG_BYTES] = "hello";
    seal_sign(&robot, message, sizeof message);
    TEST_ASSERT_EQUAL_MEMORY(hello_tag, message + 5, sizeof hello_tag);
    TEST_ASSERT_TRUE(seal_verify(&robot, message, sizeof message));
}

static void test_any_changed_bit_and_any_other_key_is_seen(void)
{
    TEST_ASSERT_TRUE(load(counting, 0600));
    const struct seal_key robot = seal_derive(&key, 3), other = seal_derive(&key, 4);
    uint8_t message[5 + SEAL_TAG_BYTES] = "hello";
    seal_sign(&robot, message, sizeof message);
    TEST_ASSERT_FALSE(seal_verify(&other, message, sizeof message));
    TEST_ASSERT_FALSE(seal_verify(&key, message, sizeof message));
    for (size_t bit = 0; bit < 8 * sizeof message; ++bit)
    {
        message[bit / 8] ^= (uint8_t)(1u << bit % 8);
        TEST_ASSERT_FALSE(seal_verify(&robot, message, sizeof message));
        message[bit / 8] ^= (uint8_t)(1u << bit % 8);
    }
    for (size_t size = 0; size < sizeof message; ++size)
    {
        TEST_ASSERT_FALSE(seal_verify(&robot, message, size));
    }
}

static void test_without_a_key_nothing_is_signed_or_believed(void)
{
    const struct seal_key none = {0};
    static const uint8_t zero[SEAL_TAG_BYTES];
    uint8_t message[5 + SEAL_TAG_BYTES] = "hello";
    memset(message + 5, 7, SEAL_TAG_BYTES);
    seal_sign(&none, message, sizeof message);
    TEST_ASSERT_EQUAL_MEMORY(zero, message + 5, sizeof zero);
    TEST_ASSERT_FALSE(seal_verify(&none, message, sizeof message));
    TEST_ASSERT_FALSE(seal_derive(&none, 3).present);
}

static void test_key_files_that_are_none_are_refused_in_words(void)
{
    TEST_ASSERT_FALSE(seal_load("/nowhere/key", &key, error));
    TEST_ASSERT_NOT_NULL(strstr(error, "/nowhere/key"));
    TEST_ASSERT_FALSE(load("", 0600));
    TEST_ASSERT_FALSE(load("0001", 0600));
    char text[80];
    (void)snprintf(text, sizeof text, "%s0", counting);
    TEST_ASSERT_FALSE(load(text, 0600));
    (void)snprintf(text, sizeof text, "g%s", counting + 1);
    TEST_ASSERT_FALSE(load(text, 0600));
    TEST_ASSERT_NOT_NULL(strstr(error, "64"));
    TEST_ASSERT_FALSE(load(counting, 0640));
    TEST_ASSERT_NOT_NULL(strstr(error, "chmod 600"));
    (void)snprintf(text, sizeof text, "%s\n", counting);
    TEST_ASSERT_TRUE(load(text, 0600));
}

static void test_name_of_a_key_is_that_of_another_implementation(void)
{
    char name[SEAL_NAME_MAX];
    TEST_ASSERT_TRUE(load(counting, 0600));
    seal_name(&key, name);
    TEST_ASSERT_EQUAL_STRING("0b9d35f9", name);
    key.present = false;
    seal_name(&key, name);
    TEST_ASSERT_EQUAL_STRING("none", name);
}

static void test_key_is_made_once_and_for_its_owner_alone(void)
{
    struct stat about;
    struct seal_key again;
    TEST_ASSERT_TRUE(seal_make(path));
    TEST_ASSERT_EQUAL(0, stat(path, &about));
    TEST_ASSERT_EQUAL_HEX32(0600, about.st_mode & 0777);
    TEST_ASSERT_TRUE(seal_load(path, &key, error));
    TEST_ASSERT_TRUE(seal_make(path));
    TEST_ASSERT_TRUE(seal_load(path, &again, error));
    TEST_ASSERT_EQUAL_MEMORY(key.bytes, again.bytes, sizeof key.bytes);
    TEST_ASSERT_FALSE(seal_make("/nowhere/key"));
}

int main(void)
{
    TEST_ASSERT_NOT_NULL(mkdtemp(folder));
    UNITY_BEGIN();
    RUN_TEST(test_signature_is_that_of_another_implementation);
    RUN_TEST(test_any_changed_bit_and_any_other_key_is_seen);
    RUN_TEST(test_without_a_key_nothing_is_signed_or_believed);
    RUN_TEST(test_key_files_that_are_none_are_refused_in_words);
    RUN_TEST(test_name_of_a_key_is_that_of_another_implementation);
    RUN_TEST(test_key_is_made_once_and_for_its_owner_alone);
    (void)rmdir(folder);
    return UNITY_END();
}
