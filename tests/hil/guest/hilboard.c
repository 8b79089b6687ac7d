// SPDX-License-Identifier: GPL-2.0-only
// The robot's hardware but for the camera, as a kernel module: an I2C bus with the motor board and
// a GPIO chip. It is under the GPL, alone of all files here, because it is built with the kernel's
// headers and uses symbols that the kernel gives to GPL modules only. It runs in the rig's guest
// and is no part of anything that is shipped.
//
// I2C: bus 1, as on the robot, with 256 registers at 0x7A behind a pointer that counts on. Like the
// real board, it knows no repeated start. GPIO: 54 lines with biases, chip "hilboard".
//
// /dev/hilboard is the rig's side. read() gives one struct hil_event per call, as it happened:
//   'I' the board took a write: reg and data; 'G' an output changed: reg is the line, data[0] its
//   level
// write() takes one command per call:
//   'R' register bytes...  sets registers, as a sensor would
//   'P' line level         drives a line from outside; level 2 lets go: the bias decides
//   'N' count              leaves the next transfers unanswered; 255: all, until told otherwise
//   'B' register           leaves writes to this register unanswered; 255: none
//   'H' tenths             makes the next reading of a line take so many tenths of a second, in
//                          which nothing can end who reads
#include <linux/delay.h>
#include <linux/gpio/driver.h>
#include <linux/i2c.h>
#include <linux/kfifo.h>
#include <linux/ktime.h>
#include <linux/miscdevice.h>
#include <linux/module.h>
#include <linux/mutex.h>
#include <linux/poll.h>
#include <linux/uaccess.h>
#include <linux/wait.h>

#define BOARD_ADDRESS 0x7a
#define BUS_NUMBER 1
#define LINES 54
#define LET_GO 2
#define NACK_ALL 255

struct hil_event
{
    __u64 t_ns;  // CLOCK_MONOTONIC
    __u8 kind, reg, length, data[21];
};

static DEFINE_MUTEX(lock);
static DEFINE_KFIFO(events, struct hil_event, 1024);
static DECLARE_WAIT_QUEUE_HEAD(readers);

// With the lock held. The oldest event goes if nobody reads.
static void add_event(__u8 kind, __u8 reg, const __u8 *data, size_t length)
{
    struct hil_event event = {.t_ns = ktime_get_ns(), .kind = kind, .reg = reg};

    event.length = min(length, sizeof event.data);
    memcpy(event.data, data, event.length);
    if (kfifo_is_full(&events))
    {
        kfifo_skip(&events);
    }
    kfifo_put(&events, event);
    wake_up_interruptible(&readers);
}

// I2C

static __u8 registers[256], pointer, nacks_left, refused_register = 255;

static void take_write(const __u8 *bytes, size_t length)
{
    size_t i;

    pointer = bytes[0];
    for (i = 1; i < length; i++)
    {
        registers[(__u8)(pointer + i - 1)] = bytes[i];
    }
    if (length > 1)
    {
        add_event('I', pointer, bytes + 1, length - 1);
    }
    pointer += length - 1;
}

static int transfer(struct i2c_adapter *bus, struct i2c_msg *message, int count)
{
    int i, result = count;

    if (count != 1)
    {
        return -EOPNOTSUPP;
    }
    mutex_lock(&lock);
    if (message->addr == BOARD_ADDRESS && !(message->flags & I2C_M_RD) && message->len > 1 &&
        message->buf[0] == refused_register)
    {
        result = -ENXIO;
    }
    else if (message->addr != BOARD_ADDRESS || nacks_left > 0)
    {
        nacks_left -= message->addr == BOARD_ADDRESS && nacks_left != NACK_ALL;
        result = -ENXIO;
    }
    else if (message->flags & I2C_M_RD)
    {
        for (i = 0; i < message->len; i++)
        {
            message->buf[i] = registers[pointer++];
        }
    }
    else if (message->len > 0)
    {
        take_write(message->buf, message->len);
    }
    mutex_unlock(&lock);
    return result;
}

static u32 functionality(struct i2c_adapter *bus)
{
    return I2C_FUNC_I2C;
}

static const struct i2c_algorithm algorithm = {.master_xfer = transfer,
                                               .functionality = functionality};
static struct i2c_adapter bus = {
    .owner = THIS_MODULE, .algo = &algorithm, .name = "hilboard", .nr = BUS_NUMBER};

// GPIO

static struct
{
    bool is_output;
    __u8 output, outside, bias;
} line_of[LINES];

static __u8 hang_tenths;

static int get_level(struct gpio_chip *chip, unsigned int n)
{
    const unsigned int hang_ms = xchg(&hang_tenths, 0) * 100;

    if (hang_ms > 0)
    {
        msleep(hang_ms);
    }
    return line_of[n].is_output           ? line_of[n].output
           : line_of[n].outside == LET_GO ? line_of[n].bias
                                          : line_of[n].outside;
}

static int set_output(struct gpio_chip *chip, unsigned int n, int value)
{
    const __u8 level = !!value;

    mutex_lock(&lock);
    if (!line_of[n].is_output || line_of[n].output != level)
    {
        add_event('G', n, &level, 1);
    }
    line_of[n].is_output = true;
    line_of[n].output = level;
    mutex_unlock(&lock);
    return 0;
}

static void set_level(struct gpio_chip *chip, unsigned int n, int value)
{
    set_output(chip, n, value);
}

static int set_input(struct gpio_chip *chip, unsigned int n)
{
    line_of[n].is_output = false;
    return 0;
}

static int get_direction(struct gpio_chip *chip, unsigned int n)
{
    return line_of[n].is_output ? GPIO_LINE_DIRECTION_OUT : GPIO_LINE_DIRECTION_IN;
}

static int set_config(struct gpio_chip *chip, unsigned int n, unsigned long config)
{
    switch (pinconf_to_config_param(config))
    {
        case PIN_CONFIG_BIAS_PULL_UP: line_of[n].bias = 1; return 0;
        case PIN_CONFIG_BIAS_PULL_DOWN:
        case PIN_CONFIG_BIAS_DISABLE: line_of[n].bias = 0; return 0;
        default: return -ENOTSUPP;
    }
}

static struct gpio_chip chip = {
    .label = "hilboard",
    .owner = THIS_MODULE,
    .base = -1,
    .ngpio = LINES,
    .can_sleep = true,
    .get = get_level,
    .set = set_level,
    .direction_input = set_input,
    .direction_output = set_output,
    .get_direction = get_direction,
    .set_config = set_config,
};

// The rig's side

static ssize_t read_event(struct file *file, char __user *to, size_t size, loff_t *offset)
{
    struct hil_event event;
    int got;

    if (size < sizeof event)
    {
        return -EINVAL;
    }
    mutex_lock(&lock);
    got = kfifo_get(&events, &event);
    mutex_unlock(&lock);
    if (!got)
    {
        return -EAGAIN;
    }
    return copy_to_user(to, &event, sizeof event) ? -EFAULT : sizeof event;
}

static ssize_t take_command(struct file *file, const char __user *from, size_t size, loff_t *offset)
{
    __u8 command[34];
    ssize_t result = size;

    if (size < 2 || size > sizeof command || copy_from_user(command, from, size))
    {
        return -EINVAL;
    }
    mutex_lock(&lock);
    if (command[0] == 'R')
    {
        memcpy(registers + command[1], command + 2, min(size - 2, sizeof registers - command[1]));
    }
    else if (command[0] == 'P' && size == 3 && command[1] < LINES)
    {
        line_of[command[1]].outside = command[2];
    }
    else if (command[0] == 'B')
    {
        refused_register = command[1];
    }
    else if (command[0] == 'H')
    {
        hang_tenths = command[1];
    }
    else if (command[0] == 'N')
    {
        nacks_left = command[1];
    }
    else
    {
        result = -EINVAL;
    }
    mutex_unlock(&lock);
    return result;
}

static __poll_t poll_events(struct file *file, poll_table *table)
{
    poll_wait(file, &readers, table);
    return EPOLLOUT | (kfifo_is_empty(&events) ? 0 : EPOLLIN);
}

static const struct file_operations operations = {
    .owner = THIS_MODULE, .read = read_event, .write = take_command, .poll = poll_events};
static struct miscdevice rig_side = {
    .minor = MISC_DYNAMIC_MINOR, .name = "hilboard", .fops = &operations};

static int __init hilboard_init(void)
{
    int i, err;

    for (i = 0; i < LINES; i++)
    {
        line_of[i].outside = LET_GO;
    }
    err = gpiochip_add_data(&chip, NULL);
    if (err)
    {
        return err;
    }
    err = i2c_add_numbered_adapter(&bus);
    if (err)
    {
        goto no_bus;
    }
    err = misc_register(&rig_side);
    if (err)
    {
        goto no_rig_side;
    }
    return 0;
no_rig_side:
    i2c_del_adapter(&bus);
no_bus:
    gpiochip_remove(&chip);
    return err;
}

static void __exit hilboard_exit(void)
{
    misc_deregister(&rig_side);
    i2c_del_adapter(&bus);
    gpiochip_remove(&chip);
}

module_init(hilboard_init);
module_exit(hilboard_exit);
MODULE_LICENSE("GPL");
MODULE_DESCRIPTION("Motor board and GPIO chip of a robot that is not there");
