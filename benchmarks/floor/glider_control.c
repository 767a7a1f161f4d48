/* Copyright 2026 The glider stack authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * glider_control in C99: allocation, steering, adaptive law, control.
 * Left out: the PID law.
 */

/* ------------------------------------------------------------------------------ allocation */

typedef struct { double roll, pitch; } Moments;

static inline Vector gravity_direction(double phi, double theta)
{
    return (Vector){-sin(theta), cos(theta) * sin(phi), cos(theta) * cos(phi)};
}

static inline double allocate_roll(
    double tau_p, double phi, double theta, const AllocationParams *params)
{
    Vector g = gravity_direction(phi, theta);
    double lever = params->m_p * params->R_p * GRAVITY;
    double a = lever * g.z, b = lever * g.y;
    double demand = (tau_p + GRAVITY * params->s_z * g.y) / max(sqrt(a * a + b * b), 1e-9);
    double mu = asin(min(1.0, max(-1.0, demand))) + atan2(b, a);
    return min(params->mu_max, max(-params->mu_max, mu));
}

static inline double allocate_pitch(
    double tau_q, double mu, double phi, double theta, const AllocationParams *params)
{
    Vector g = gravity_direction(phi, theta);
    double s_z = params->s_z + params->m_p * params->R_p * cos(mu);
    double s_x = (s_z * g.x - tau_q / GRAVITY) / max(g.z, SMALLEST_G_Z);
    double x_p = (s_x - params->s_x) / params->m_p - params->x_p0;
    return min(params->x_p_max, max(-params->x_p_max, x_p));
}

static inline Moments moments(
    double x_p, double mu, double phi, double theta, const AllocationParams *params)
{
    Vector g = gravity_direction(phi, theta);
    double s_x = params->s_x + params->m_p * (params->x_p0 + x_p);
    double s_y = params->m_p * params->R_p * sin(mu);
    double s_z = params->s_z + params->m_p * params->R_p * cos(mu);
    return (Moments){GRAVITY * (s_y * g.z - s_z * g.y), GRAVITY * (s_z * g.x - s_x * g.z)};
}

/* -------------------------------------------------------------------------------- steering */

static inline double caution(const SteeringState *state)
{
    double square = state->b * state->b;
    return square / (square + max(0.0, state->p[0] - SURE_SHARE * SURE_SHARE * square));
}

static inline double sure_disturbance(const SteeringState *state)
{
    double square = state->d * state->d;
    return state->d * square / (square + state->p[9]);
}

static inline double roll_to_kick(const SteeringState *state, double error)
{
    double sine = state->k / (state->k * state->k + state->p[7]);
    if (state->is_kicked)
        return sine * error;
    if (state->b * state->k <= 0.0)
        return 0.0;
    return (1.0 - caution(state)) * sine * min(KICK_ERROR, max(-KICK_ERROR, error));
}

/* Returns the sine of roll; the largest one of use goes to most. */
static inline double roll_to_turn(
    const SteeringState *state, double turn, double ratio, double limit, double *most)
{
    double b = state->b, c = state->c;
    if (b * c < 0.0)
        limit = min(limit, SHARE_OF_PEAK * sqrt(-b / (3.0 * c)));
    double sine = 0.0;
    if (fabs(b) > SMALLEST_STEERING) {
        double part = turn / ratio * caution(state);
        for (int i = 0; i < 4; i++) {
            sine += (part - (b + c * sine * sine) * sine) / (b + 3.0 * c * sine * sine);
            sine = min(limit, max(-limit, sine));
        }
    }
    *most = limit;
    return sine;
}

/* ------------------------------------------------------------------------------- adaptive */

static inline double project(
    double theta, double direction, double sigma, const ChannelParams *params, double dt)
{
    double moved = theta + dt * params->gamma * (direction - sigma * theta);
    return min(params->bound, max(-params->bound, moved));
}

typedef struct {
    Filtered filtered;
    double xi, zeta, k1_bar, k2, k2_bar;
} Channel;

static inline Channel channel_step(
    const ChannelState *state, double error, double command, double rate, double applied,
    double coupling, const ChannelParams *params, double dt)
{
    Filtered filtered = filter_command(state->rate, command, RATE_FILTER, dt);
    double xi
        = state->xi + dt * (-params->l1 * state->xi + coupling * (filtered.value - command));
    double zeta = (state->zeta + dt * (applied - state->tau) / params->inertia)
        / (1.0 + dt * params->b2 / params->inertia);
    double k2 = rate - filtered.value;
    return (Channel){filtered, xi, zeta, error - xi, k2, k2 - zeta};
}

/* Returns the roll command and changes the disturbance. */
static inline double bank_to_turn(
    const SteeringState *steering, double *disturbance, const Measured *measured,
    const Reference *reference, double speed, bool learning, const AdaptiveParams *params,
    double dt)
{
    double limit = sin(params->roll_limit);
    double ratio = speed_ratio(speed);
    double effectiveness = fabs(steering->b) * ratio;
    bool is_known = steering->p[0] < steering->b * steering->b;
    double bandwidth = effectiveness * limit / SATURATING_ERROR;
    if (is_known)
        bandwidth
            = (steering->b * steering->k < 0.0 ? BANDWIDTH_AGAINST_KICK : BANDWIDTH_WITH_KICK)
            * effectiveness / max(fabs(steering->k), SMALLEST_KICK);
    double share = min(1.0, bandwidth / params->heading_kp);
    double asked = share * reference->psi_dot;
    double most;
    double turning
        = roll_to_turn(steering, asked - sure_disturbance(steering), ratio, limit, &most);
    double roll_left = measured->phi - asin(turning);
    double error = wrap_angle(reference->psi - measured->psi + steering->k * roll_left);
    double psi_dot = measured->psi_dot - steering->k * measured->phi_dot;
    double turn = asked + share * params->heading_kp * error
        + share * params->heading_kd * (reference->psi_dot - psi_dot) - *disturbance;
    double sine = roll_to_turn(steering, turn, ratio, limit, &most);
    if (steering->is_kicked)
        sine = 0.0;
    if (learning)
        sine = min(limit, max(-limit, sine + roll_to_kick(steering, error)));
    if (learning && is_known && !steering->is_kicked && fabs(sine) < most) {
        double learnt = min(DISTURBANCE_ERROR, max(-DISTURBANCE_ERROR, error));
        double moved = *disturbance - dt * share * share * params->heading_ki * learnt;
        *disturbance = min(DISTURBANCE_MAX, max(-DISTURBANCE_MAX, moved));
    }
    return asin(sine);
}

static inline Moments adaptive_step(
    AdaptiveState *state, const Measured *measured, const Reference *reference, double speed,
    double alpha, double m_b, Moments applied, bool roll_held, bool pitch_held,
    const AdaptiveParams *params, double dt)
{
    Steering *steering = &state->steering;
    learn(steering, measured, speed, &params->steering, dt);
    bool learning = steering->steady_s > LEARN_AFTER_S;
    double roll_command = 0.0;
    if (steering->steady_s > 0.0 && measured->vertical_rate > 0.0)
        roll_command = bank_to_turn(
            &steering->dive, &state->disturbance_dive, measured, reference, speed, learning,
            params, dt);
    else if (steering->steady_s > 0.0)
        roll_command = bank_to_turn(
            &steering->climb, &state->disturbance_climb, measured, reference, speed, learning,
            params, dt);
    Filtered roll = filter_command(state->roll, roll_command, params->roll_filter, dt);

    double s_phi = sin(measured->phi), c_phi = cos(measured->phi);
    double t_theta = tan(measured->theta);
    double c_theta = cos(measured->theta);
    double p = measured->phi_dot - sin(measured->theta) * measured->psi_dot;
    double q = c_phi * measured->theta_dot + s_phi * c_theta * measured->psi_dot;
    double r = c_phi * c_theta * measured->psi_dot - s_phi * measured->theta_dot;

    double e_phi = wrap_angle(measured->phi - roll.value);
    double e_theta = measured->theta - reference->theta;
    double a_phi = roll.rate - params->roll.l1 * e_phi;
    double a_theta = reference->theta_dot - params->pitch.l1 * e_theta;
    double a_q = (a_theta + s_phi * r) / max(c_phi, 0.2);
    double a_p = a_phi - c_phi * t_theta * r - s_phi * t_theta * a_q;

    Channel one = channel_step(
        &state->roll_channel, e_phi, a_p, p, applied.roll, 1.0, &params->roll, dt);
    Channel two = channel_step(
        &state->pitch_channel, e_theta, a_q, q, applied.pitch, c_phi, &params->pitch, dt);

    double v2 = speed * speed;
    double side = params->mass * speed * r - m_b * GRAVITY * c_theta * s_phi;
    double phi_p[3] = {1.0, side / SCALE_SIDE, one.filtered.value / SCALE_ROLL_RATE};
    double phi_q[4] = {
        1.0, v2 * alpha / SCALE_ALPHA, v2 / SCALE_V2, two.filtered.value / SCALE_PITCH_RATE};

    double *th_p = state->roll_theta, *th_q = state->pitch_theta;
    double tau_p = params->roll.inertia * one.filtered.rate - params->roll.b2 * one.k2
        - params->roll.b1 * one.k1_bar
        - (phi_p[0] * th_p[0] + phi_p[1] * th_p[1] + phi_p[2] * th_p[2]);
    double tau_q = params->pitch.inertia * two.filtered.rate - params->pitch.b2 * two.k2
        - params->pitch.b1 * c_phi * two.k1_bar
        - params->roll.b1 * s_phi * t_theta * one.k1_bar
        - (phi_q[0] * th_q[0] + phi_q[1] * th_q[1] + phi_q[2] * th_q[2] + phi_q[3] * th_q[3]);

    if (learning && !roll_held && fabs(one.k2_bar) > params->roll.dead_zone)
        for (int i = 0; i < 3; i++)
            th_p[i]
                = project(th_p[i], phi_p[i] * one.k2_bar, params->roll.sigma, &params->roll, dt);
    if (learning && !pitch_held && fabs(two.k2_bar) > params->pitch.dead_zone)
        for (int i = 0; i < 4; i++)
            th_q[i] = project(
                th_q[i], phi_q[i] * two.k2_bar, params->pitch.sigma, &params->pitch, dt);
    state->roll = roll;
    state->roll_channel
        = (ChannelState){one.filtered, one.xi, one.zeta, tau_p, one.k1_bar, one.k2_bar};
    state->pitch_channel
        = (ChannelState){two.filtered, two.xi, two.zeta, tau_q, two.k1_bar, two.k2_bar};
    return (Moments){tau_p, tau_q};
}

static inline Adaptation adaptation(const AdaptiveState *state, const AdaptiveParams *params)
{
    const ChannelState *roll = &state->roll_channel, *pitch = &state->pitch_channel;
    double v_1 = 0.5
        * (params->roll.b1 * roll->k1 * roll->k1 + params->pitch.b1 * pitch->k1 * pitch->k1);
    double v_2 = v_1
        + 0.5
            * (params->roll.inertia * roll->k2 * roll->k2
               + params->pitch.inertia * pitch->k2 * pitch->k2);
    const double *th_p = state->roll_theta, *th_q = state->pitch_theta;
    return (Adaptation){
        th_p[0], th_p[1], th_p[2], th_q[0], th_q[1], th_q[2], th_q[3],
        state->steering.dive.b, state->disturbance_dive, state->steering.climb.b,
        state->disturbance_climb,
        v_1, v_2,
    };
}

/* --------------------------------------------------------------------------------- control */

typedef struct {
    Joints command;
    Wrench wrench;
    Adaptation adaptation;
    int64_t saturation;
} ControlOutput;

static inline double hold(double command, double last, double band, double limit)
{
    return fabs(command - last) <= band && fabs(command) < limit ? last : command;
}

/* Returns the net heaviness and changes the trim. */
static inline double vertical_rate_law(
    Trim *trim, const Measured *measured, const Reference *reference, const Joints *joints,
    const ControlParams *params, double dt)
{
    double sign = reference->v_d > 0.0 ? 1.0 : -1.0;
    double wanted = glide_net_heaviness(reference->theta, reference->v_d, &params->polar)
        + sign * trim->drag;
    double error = reference->v_d - measured->vertical_rate;
    double limit = params->allocation.m_b_max;
    bool steady
        = fabs(error) < VERTICAL_RATE_WINDOW && fabs(joints->m_b - wanted - trim->ballast) < 0.05;
    if (steady) {
        double most = params->buoyancy_trim_max;
        trim->ballast
            = min(most, max(-most, trim->ballast + dt * params->buoyancy_ki * error));
        trim->drag = min(most, max(-most, trim->drag + dt * params->drag_ki * error * sign));
    }
    return min(limit, max(-limit, wanted + trim->ballast));
}

static inline ControlOutput control_step(
    ControlState *state, const Odometry *odometry, const Joints *joints,
    const Reference *reference, const ControlParams *params, double dt)
{
    bool first = state->tick == 0;
    Joints last = first ? *joints : state->command;
    const AllocationParams *limits = &params->allocation;
    Measured measured = measure(state->measured, odometry, first, params->attitude_s, dt);
    double alpha;
    double speed = glide_speed(measured.theta, measured.vertical_rate, &params->polar, &alpha);

    Moments tau = adaptive_step(
        &state->adaptive, &measured, reference, speed, alpha, joints->m_b,
        moments(joints->x_p, joints->mu, measured.phi, measured.theta, limits),
        fabs(last.mu) >= limits->mu_max, fabs(last.x_p) >= limits->x_p_max,
        &params->adaptive, dt);
    double m_b
        = vertical_rate_law(&state->trim, &measured, reference, joints, params, dt);
    double mu = allocate_roll(tau.roll, measured.phi, measured.theta, limits);
    double x_p = allocate_pitch(tau.pitch, joints->mu, measured.phi, measured.theta, limits);

    Joints command = {
        hold(m_b, last.m_b, params->dead_band.m_b, limits->m_b_max),
        hold(x_p, last.x_p, params->dead_band.x_p, limits->x_p_max),
        hold(mu, last.mu, params->dead_band.mu, limits->mu_max),
    };
    int64_t saturation = 0;
    if (fabs(command.m_b) >= limits->m_b_max)
        saturation |= SATURATED_BUOYANCY;
    if (fabs(command.x_p) >= limits->x_p_max)
        saturation |= SATURATED_PITCH;
    if (fabs(command.mu) >= limits->mu_max)
        saturation |= SATURATED_ROLL;
    state->tick += 1;
    state->measured = measured;
    state->command = command;
    return (ControlOutput){
        command,
        {m_b * GRAVITY, tau.roll, tau.pitch},
        adaptation(&state->adaptive, &params->adaptive),
        saturation,
    };
}
