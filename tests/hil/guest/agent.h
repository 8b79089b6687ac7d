// SPDX-License-Identifier: Apache-2.0
// The rig's hand inside the guest: does what the host says through a virtio-serial port, and
// reports what the robot's program does to its hardware.
#ifndef HIL_AGENT_H
#define HIL_AGENT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define AGENT_MAX_ARGUMENTS 32

// Both ways: a header, then `length` bytes.
struct agent_header
{
    uint8_t type, pad[3];
    uint32_t length;
};

// CLOCK_MONOTONIC, the clock of the module's events and of camera frames.
uint64_t now_ns(void);
// Says on the console what failed, with errno.
void complain(const char *what);

// boot.c: all of it may have been done by another init before.
void boot_mount(void);
void boot_load_modules(void);
void boot_join_multicast_to_lo(void);
// @return 0, or -1 and errno.
int load_module(const char *path, const char *parameters);

// standstill.c: looks at the clock from now on. @return false, and errno, if it cannot.
bool standstill_watch(void);
// @return for how long nothing ran in the guest, at most, since this was asked; 0: not for long.
uint64_t standstill_take_ns(void);

// camera.c: @return 0 or a number of bytes, or -1 and errno.
// Opens the writing end of a loopback camera, which gives YUYV frames of this size from now on.
int camera_open(const char *device, int width_px, int height_px);
// One frame, or a part of one.
long camera_write(const uint8_t *frame, size_t length);
// Sets a control by the driver's own name of it; a menu by its entry, a button by anything.
int camera_control(const char *device, const char *name, const char *value);

#endif
