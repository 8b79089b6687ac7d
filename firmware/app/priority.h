// SPDX-License-Identifier: Apache-2.0
// What keeps a process on time: its pages stay in memory, and it goes before others.
#ifndef APP_PRIORITY_H
#define APP_PRIORITY_H

// How far below what the limits allow.
enum priority_rank
{
    PRIORITY_WATCHES = 0,
    PRIORITY_DRIVES = 1,
};

// Takes what the limits of this process allow, as those of the robot's service do: pages that were
// touched are never written to the card again, and the scheduler runs it in real time. By hand the
// limits allow neither, and nothing changes. Children inherit the scheduling, not the locked pages.
// @param rank who watches goes before whom it watches, which may never pause.
void priority_take(enum priority_rank rank);

#endif
