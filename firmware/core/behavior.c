// SPDX-License-Identifier: Apache-2.0
// The authors' tables read (speed, direction, turn) with turn positive clockwise. Here direction 90
// is a positive and 270 a negative speed, and turn is positive counter-clockwise.
#include "fw/behavior.h"

#include <string.h>

// self_centering spins at -3 times the rate w of milling's circle while it sees nothing. Milling
// turns at 0.5 rad/s (measured, turn input 0.5 at full speed), so -1.5 rad/s are wanted. On the
// spot, turn input 0.3 (duty 37) gives 1.66 rad/s (measured): with the lever arm of 0.126 m that is
// 0.209 m/s at the wheels. Duty 50 gives 0.282 m/s (measured), so a duty point is worth 0.0056 m/s.
// 1.5 rad/s is 0.020 m/s less, 3.6 points; in proportion it would be 3.6 as well. Turn input 0.27
// is duty 34. Seeing turns left (positive), so seeing nothing turns right.
#define SELF_CENTERING_SPIN_MILLI (-270)

static const struct fw_behavior behaviors[] = {
    // Scatter: back off from a neighbour, else spin.
    {.name = "diffusing", .table = {1, {{0, -2000}, {-50, 0}}}},
    // Drive at what is seen, else spin.
    {.name = "diffusing_v2", .table = {1, {{0, -500}, {100, 0}}}},
    // Spin away from a neighbour, else drive straight.
    {.name = "disperse", .table = {1, {{100, 0}, {100, 2000}}}},
    // Drive at what is seen, else circle left until something is.
    {.name = "follow_leader", .table = {1, {{75, 500}, {75, 0}}}},
    // The swarm turns in one circle.
    {.name = "milling", .table = {1, {{100, -500}, {100, 500}}}},
    // Milling as found by an evolution strategy.
    {.name = "milling_cmaes", .table = {1, {{95, 900}, {95, -200}}}},
    // Milling as used to test the effect of delay.
    {.name = "milling_delay", .table = {1, {{100, 500}, {100, 0}}}},
    // Circle a neighbour.
    {.name = "orbit", .table = {1, {{100, 650}, {100, -650}}}},
    // Gather: circle left when seeing, else spin right three times as fast.
    {.name = "self_centering", .table = {1, {{0, SELF_CENTERING_SPIN_MILLI}, {100, 500}}}},
    // Drive at what is seen, else circle right until something is.
    {.name = "shell", .table = {1, {{100, -500}, {100, 0}}}},
};

static const size_t behavior_count = sizeof behaviors / sizeof behaviors[0];

const struct fw_behavior *fw_behavior_find(const char *name)
{
    for (size_t i = 0; i < behavior_count; ++i)
    {
        if (strcmp(behaviors[i].name, name) == 0)
        {
            return &behaviors[i];
        }
    }
    return NULL;
}

size_t fw_behavior_count(void)
{
    return behavior_count;
}

const struct fw_behavior *fw_behavior_at(size_t index)
{
    return index < behavior_count ? &behaviors[index] : NULL;
}
