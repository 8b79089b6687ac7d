// SPDX-License-Identifier: Apache-2.0
#include "loop_update.h"

#include "loop_link.h"

#define BATTERY_PERIOD_US 1000000
#define BUZZER_HALF_PERIOD_US 500000
// A reading outside is no pack of two cells: unknown.
#define PACK_MIN_MV 5000
#define PACK_MAX_MV 8500

// Down when seen down in two steps, so that a bounce is no press.
static void press_button(struct loop *loop, bool pressed)
{
    const bool down = pressed && loop->button_seen;
    if (down && !loop->button_down)
    {
        if (loop->running || loop->plan.waits)
        {
            loop_stop(loop);
        }
        else if (!loop->battery_low)
        {
            loop_link_start_by_hand(loop);
        }
    }
    loop->button_seen = pressed;
    loop->button_down = down;
}

void loop_update_panel(struct loop *loop, bool detected)
{
    const int64_t now_us = loop_now_us(loop);
    if (loop->lost[LOOP_PANEL] != FW_OK && now_us < loop->retry_us[LOOP_PANEL])
    {
        return;
    }
    const struct hal_lights lights = {
        .detected = detected,
        .running = loop->running,
        .buzzer = loop->battery_low && now_us / BUZZER_HALF_PERIOD_US % 2 == 0,
    };
    bool pressed = false;
    enum fw_err err = hal_panel_read_button(&loop->devices.panel, &pressed);
    if (err == FW_OK)
    {
        err = hal_panel_show(&loop->devices.panel, &lights);
    }
    if (err != FW_OK)
    {
        loop_lose(loop, LOOP_PANEL, err);
        return;
    }
    loop_regain(loop, LOOP_PANEL);
    press_button(loop, pressed);
}

// The load makes the voltage dip: the battery is low when even the best of the newest readings is.
static void judge_battery(struct loop *loop)
{
    bool low = loop->battery_count >= LOOP_BATTERY_READINGS;
    for (int i = 0; i < LOOP_BATTERY_READINGS; ++i)
    {
        low = low && loop->battery_mV[i] < loop->battery_low_mV;
    }
    loop->battery_low = loop->battery_low || low;
}

void loop_update_battery(struct loop *loop)
{
    const int64_t now_us = loop_now_us(loop);
    if (now_us < loop->battery_next_us)
    {
        return;
    }
    int32_t pack_mV = 0;
    const enum fw_err err = hal_battery_read(&loop->devices.battery, &pack_mV);
    if (err != FW_OK && err != FW_ERR_TIMEOUT)
    {
        loop_lose(loop, LOOP_BATTERY, err);
        loop->battery_next_us = loop->retry_us[LOOP_BATTERY];
        return;
    }
    loop->battery_next_us = now_us + BATTERY_PERIOD_US;
    loop_regain(loop, LOOP_BATTERY);
    if (err == FW_OK && pack_mV >= PACK_MIN_MV && pack_mV <= PACK_MAX_MV)
    {
        loop->battery_mV[loop->battery_count++ % LOOP_BATTERY_READINGS] = pack_mV;
        judge_battery(loop);
    }
}
