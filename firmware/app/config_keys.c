// SPDX-License-Identifier: Apache-2.0
#include "config_keys.h"

#include <stddef.h>

// One row a key, read twice: for its place and range, and for its texts.
#define KEYS(INTEGER, TEXT, YES_NO, BIT, SIGN)                                                     \
    INTEGER(robot_id, 0, 99, "number of this robot, in the names of its channels")                 \
    TEXT(behavior, "name of the table that is played")                                             \
    TEXT(table,                                                                                    \
         "table of your own, played under the name above: speed and turn input for nothing"        \
         " seen, then for seen, as in 100,-0.5,100,0.5, or so for each number of k bits;"          \
         " empty: that of this name in the "                                                       \
         "file below, or else built in")                                                           \
    TEXT(behaviors,                                                                                \
         "file of such tables, lines name = \"100,-0.5,100,0.5\", which commands can name;"        \
         " empty: none")                                                                           \
    YES_NO(autostart,                                                                              \
           "true: drive as soon as frames come, if run_dir can be written; false: wait for"        \
           " button or command")                                                                   \
    INTEGER(y_min, 0, 255, "target's colour, YUV of BT.601, both ends included")                   \
    INTEGER(y_max, 0, 255, "as above")                                                             \
    INTEGER(u_min, 0, 255, "as above")                                                             \
    INTEGER(u_max, 0, 255, "as above")                                                             \
    INTEGER(v_min, 0, 255, "as above")                                                             \
    INTEGER(v_max, 0, 255, "as above")                                                             \
    INTEGER(min_blob_px, 0, 1000000, "the target is seen if its largest blob has more pixels")     \
    INTEGER(vote_frames, 1, 64, "the vote is over this many frames at most")                       \
    INTEGER(vote_window_ms, 0, 60000, "and over those of the last ms; 0: of any age")              \
    BIT(bit1, 0,                                                                                   \
        "sector of the picture: all, left or right; and what differs from the keys above: "        \
        "y_min,y_max,u_min,u_max,v_min,v_max,min_blob_px,vote_frames,vote_window_ms")              \
    BIT(bit2, 1, "a second bit, for tables of 4 rows; empty: none")                                \
    BIT(bit3, 2, "for 8 rows")                                                                     \
    BIT(bit4, 3, "for 16 rows")                                                                    \
    INTEGER(frame_timeout_ms, 1, 10000, "motors stop without a frame for this long")               \
    INTEGER(duty_cap_pct, 0, 100, "largest duty of any wheel; 0: never turns")                     \
    TEXT(camera, "V4L2 device, or stub:FILE of YUYV frames, or stub:unix:SOCKET")                  \
    INTEGER(width_px, 2, 1280, "frame size asked for; the camera's nearest is taken")              \
    INTEGER(height_px, 1, 1024, "as above")                                                        \
    INTEGER(rate_Hz, 1, 240, "frame rate asked for")                                               \
    INTEGER(exposure_100us, -1, 100000, "0: locked as it is, -1: automatic")                       \
    INTEGER(white_balance_K, -1, 10000, "0: locked as it is, -1: automatic")                       \
    INTEGER(frozen_ms, 0, 60000,                                                                   \
            "motors stop while the picture has been one and the same, bit for bit, for "           \
            "this long; 0: never")                                                                 \
    TEXT(board,                                                                                    \
         "auto, i2c (Pi 4 kit), uart (Pi 5 kit), stub, stub:FILE that records duties, "            \
         "stub:camera that answers them through the camera's socket")                              \
    TEXT(i2c_device, "bus of the Pi 4 kit's board")                                                \
    TEXT(uart_device, "serial line of the Pi 5 kit's board")                                       \
    YES_NO(i2c_burst, "true: four duties in one transfer; false: one by one")                      \
    YES_NO(board_confirms,                                                                         \
           "true: a stop counts once the board confirms it, by its registers (Pi 4 kit) or"        \
           " by being heard (Pi 5 kit); false: once it was taken")                                 \
    INTEGER(board_retry_ms, 0, 100, "a refused transfer is tried again for this long")             \
    SIGN(sign_fl, FW_FRONT_LEFT, "1 or -1: which way a positive duty turns the wheel; 0: never")   \
    SIGN(sign_fr, FW_FRONT_RIGHT, "as above")                                                      \
    SIGN(sign_rl, FW_REAR_LEFT, "as above")                                                        \
    SIGN(sign_rr, FW_REAR_RIGHT, "as above")                                                       \
    INTEGER(battery_low_mV, 0, 8500, "motors stop for good when the pack stays below")             \
    TEXT(panel, "gpio or none")                                                                    \
    TEXT(gpio_chip,                                                                                \
         "chip of the lines below: auto (a Raspberry Pi's header), a label as gpiodetect "         \
         "prints it, or a path")                                                                   \
    INTEGER(button_line, 0, 1023, "start/stop button, low while pressed")                          \
    INTEGER(detected_line, 0, 1023, "LED: target detected")                                        \
    INTEGER(running_line, 0, 1023, "LED: running")                                                 \
    INTEGER(buzzer_line, 0, 1023, "sounds while the battery is low")                               \
    TEXT(script, "input script that is played instead of the table; empty: none")                  \
    TEXT(script_dir, "folder of the scripts that commands name")                                   \
    TEXT(lcm_url,                                                                                  \
         "where telemetry goes, and, if it is udpm://, commands come from; empty: nowhere")        \
    TEXT(key_file,                                                                                 \
         "this robot's key, mode 600: without it nothing but a stop is obeyed over the "           \
         "network")                                                                                \
    INTEGER(link_timeout_ms, 0, 600000,                                                            \
            "a robot that was started over the network stops when its operator is not "            \
            "heard for this long, unless the start says otherwise; 0: never")                      \
    TEXT(run_dir, "folder, empty after every boot, that keeps in mind that the robot was stopped") \
    TEXT(io_tsv, "log in the format of the authors' robots; empty: none")                          \
    INTEGER(watchdog_ms, 100, 10000, "a program that hangs this long while moving is killed")      \
    INTEGER(restart_ms, -1, 60000, "pause before a dead program is started again; -1: never")

#define FIELD(member) offsetof(struct app_config, member)
#define INTEGER_PLACE(name, lowest, highest, words) \
    {.kind = KEY_INTEGER, .offset = FIELD(name), .min = lowest, .max = highest},
#define TEXT_PLACE(name, words) {.kind = KEY_TEXT, .offset = FIELD(name)},
#define YES_NO_PLACE(name, words) {.kind = KEY_BOOL, .offset = FIELD(name)},
#define BIT_PLACE(name, index, words) \
    {.kind = KEY_TEXT, .offset = FIELD(bits) + CONFIG_TEXT_MAX * (index)},
#define SIGN_PLACE(name, wheel, words) \
    {.kind = KEY_INTEGER, .offset = FIELD(sign[wheel]), .min = -1, .max = 1},

const struct config_key config_keys[] = {
    KEYS(INTEGER_PLACE, TEXT_PLACE, YES_NO_PLACE, BIT_PLACE, SIGN_PLACE)};
const size_t config_key_count = sizeof config_keys / sizeof config_keys[0];

#define TEXTS(name, words) #name "\0" words "\0"
#define INTEGER_TEXTS(name, lowest, highest, words) TEXTS(name, words)
#define SIGN_TEXTS(name, wheel, words) TEXTS(name, words)

const char config_texts[] = KEYS(INTEGER_TEXTS, TEXTS, TEXTS, SIGN_TEXTS, SIGN_TEXTS);
