/* Copyright 2026 The glider stack authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * The floor: what `direct.fly` costs a C compiler. One translation unit, so that it may inline.
 *
 * names.h is generated from the Python (floor.py): every NamedTuple as a struct, every constant
 * of a module as a macro, every start of a column of the log as COLUMN_name.
 * Ported is what a straight path in a constant current without noise needs, by the adaptive law.
 */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

/* As the kernels are. */
#define inline inline __attribute__((always_inline))

#include "names.h"

#include "glider_model.c"
#include "glider_guidance.c"
#include "glider_control.c"

/* Numbers of one message into a row of the log. */
#define PUT(start, values) memcpy(row + (start), &(values), sizeof(values))

/* Fly until the log is full or the mission ends; returns the number of rows filled. */
int64_t fly(
    MissionState *state, const MissionParams *params, double *log, int64_t n, double dt,
    bool *finished)
{
    for (int64_t i = 0; i < n; i++) {
        double *row = log + i * ROW;
        double odometry_wire[13], water_wire[3], reference_wire[13];
        double current_wire[3], wrench_wire[3];
        Odometry measured = plant_odometry(&state->plant);
        odometry_to_wire(&measured, odometry_wire);
        Odometry odometry = odometry_from_wire(odometry_wire);
        Joints joints = state->plant.joints;
        Water water = current_step(&state->current, &params->current);
        water_to_wire(&water, water_wire);
        GuidanceOutput guided
            = guidance_step(&state->guidance, &odometry, &params->guidance, dt);
        reference_to_wire(&guided.reference, reference_wire);
        Reference reference = reference_from_wire(reference_wire);
        ControlOutput controlled = control_step(
            &state->control, &odometry, &joints, &reference, &params->control, dt);
        water_to_wire(&guided.current, current_wire);
        wrench_to_wire(&controlled.wrench, wrench_wire);
        PUT(COLUMN_odom, odometry_wire);
        PUT(COLUMN_joint_states, joints);
        PUT(COLUMN_current_velocity, water_wire);
        PUT(COLUMN_reference, reference_wire);
        PUT(COLUMN_tracking_error, guided.error);
        PUT(COLUMN_current_estimate, current_wire);
        PUT(COLUMN_command, controlled.command);
        PUT(COLUMN_wrench, wrench_wire);
        PUT(COLUMN_adaptation, controlled.adaptation);
        row[COLUMN_stage] = guided.stage;
        row[COLUMN_infeasible] = guided.infeasible;
        row[COLUMN_saturation] = controlled.saturation;
        *finished = plant_finished(&state->plant, &params->plant);
        plant_step(
            &state->plant, controlled.command, water_from_wire(water_wire), &params->plant, dt);
        if (*finished)
            return i + 1;
    }
    return n;
}

/* Steps of the plant alone; rows of log get the 13 numbers of the motion. */
void plant_steps(
    PlantState *state, const PlantParams *params, const Joints *commands, const Water *waters,
    int64_t n, double dt, Motion *log)
{
    for (int64_t row = 0; row < n; row++) {
        plant_step(state, commands[row], waters[row], params, dt);
        log[row] = state->motion;
    }
}
