// SPDX-License-Identifier: Apache-2.0
// Prints the tables of firmware/README.md that say when the wheels may turn, as the program has
// them.
#include <stdio.h>

#include "robot_state.h"

static const char *state_name(int state)
{
    return robot_state_words[state].name;
}

static const char *condition_name(int condition)
{
    return robot_condition_words[condition].name;
}

// Names of a set, or what all of them are called.
static void print_set(uint8_t set, int count, uint8_t all, const char *all_words,
                      const char *(*name)(int one))
{
    if (set == all)
    {
        (void)fputs(all_words, stdout);
        return;
    }
    const char *between = "";
    for (int one = 0; one < count; ++one)
    {
        if ((set & ROBOT_BIT(one)) != 0)
        {
            (void)printf("%s`%s`", between, name(one));
            between = ", ";
        }
    }
}

static void print_conditions(const char *before, uint8_t set)
{
    (void)fputs(before, stdout);
    print_set(set, ROBOT_CONDITION_COUNT, ROBOT_ALL_CONDITIONS, "all conditions", condition_name);
}

static void print_transition(const struct robot_transition *transition)
{
    (void)fputs("| ", stdout);
    print_set(transition->from, ROBOT_STATE_COUNT, ROBOT_ALL_STATES, "any", state_name);
    (void)printf(" | `%s` | ", state_name(transition->to));
    if (transition->all_of != 0)
    {
        print_conditions("", transition->all_of);
    }
    if (transition->not_all_of != 0)
    {
        print_conditions(transition->all_of != 0 ? ", not " : "not ", transition->not_all_of);
    }
    (void)puts(" |");
}

int main(void)
{
    (void)puts("| condition | true while | if not, telemetry says |\n|---|---|---|");
    for (int i = 0; i < ROBOT_CONDITION_COUNT; ++i)
    {
        const struct robot_condition_words *words = &robot_condition_words[i];
        (void)printf("| `%s` | %s | %s |\n", words->name, words->true_while,
                     words->else_telemetry_says);
    }
    (void)puts("\n| state | mode in telemetry | wheels |\n|---|---|---|");
    for (int i = 0; i < ROBOT_STATE_COUNT; ++i)
    {
        const struct robot_state_words *words = &robot_state_words[i];
        (void)printf("| `%s` | %s | %s |\n", words->name, words->mode, words->wheels);
    }
    (void)puts("\n| from | to | when; the first that fits is taken |\n|---|---|---|");
    for (int i = 0; i < ROBOT_TRANSITION_COUNT; ++i)
    {
        print_transition(&robot_transitions[i]);
    }
    return 0;
}
