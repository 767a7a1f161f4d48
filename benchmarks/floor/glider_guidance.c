/* Copyright 2026 The glider stack authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * glider_guidance in C99: path, profile, line of sight, current observer, guidance.
 * Left out: paths of more than one piece and helices, flight along a path in three dimensions.
 */

/* ------------------------------------------------------------------------------------ path */

typedef struct { Vector point, tangent; } Piece;

static inline Piece piece(double s, const PathParams *params)
{
    double x = s - params->knots[0];
    const double *n = params->coefficients, *e = n + 4, *d = e + 4;
    return (Piece){
        {
            n[0] + x * (n[1] + x * (n[2] + x * n[3])),
            e[0] + x * (e[1] + x * (e[2] + x * e[3])),
            d[0] + x * (d[1] + x * (d[2] + x * d[3])),
        },
        {
            n[1] + x * (2.0 * n[2] + 3.0 * x * n[3]),
            e[1] + x * (2.0 * e[2] + 3.0 * x * e[3]),
            d[1] + x * (2.0 * d[2] + 3.0 * x * d[3]),
        },
    };
}

static inline double locate(double s, const PathParams *params)
{
    return min(max(s, 0.0), params->knots[1]);
}

static inline Vector path_point(double s, const PathParams *params)
{
    double inside = locate(s, params);
    Piece one = piece(inside, params);
    double beyond = s - inside;
    return (Vector){
        one.point.x + beyond * one.tangent.x,
        one.point.y + beyond * one.tangent.y,
        one.point.z + beyond * one.tangent.z,
    };
}

static inline Vector path_tangent(double s, const PathParams *params)
{
    return piece(locate(s, params), params).tangent;
}

static inline double path_turn(double s, const PathParams *params)
{
    Vector one = path_tangent(s, params);
    Vector two = path_tangent(s + TURN_STEP_M, params);
    double turn = atan2(one.x * two.y - one.y * two.x, one.x * two.x + one.y * two.y);
    return fabs(turn) < CORNER_RAD ? turn / TURN_STEP_M : 0.0;
}

static inline TrackingError path_errors(
    double p_n, double p_e, double p_d, double s, double gamma_d, double rho_d,
    const PathParams *params)
{
    Vector target = path_point(s, params);
    double dn = p_n - target.x, de = p_e - target.y, dd = p_d - target.z;
    double cg = cos(gamma_d), sg = sin(gamma_d), cr = cos(rho_d), sr = sin(rho_d);
    double ahead = cg * dn + sg * de;
    return (TrackingError){cr * ahead - sr * dd, cg * de - sg * dn, sr * ahead + cr * dd};
}

/* Horizontal distance to a point of the piece, and half the derivative of its square by s. */
static inline double distance(
    double s, double p_n, double p_e, const PathParams *params, double *slope)
{
    Piece one = piece(s, params);
    double n = one.point.x - p_n, e = one.point.y - p_e;
    *slope = n * one.tangent.x + e * one.tangent.y;
    return hypot(n, e);
}

static inline double nearest_between(
    double low, double high, double p_n, double p_e, const PathParams *params, double *nearest)
{
    double slope;
    for (int i = 0; i < BISECTIONS; i++) {
        double middle = 0.5 * (low + high);
        distance(middle, p_n, p_e, params, &slope);
        if (slope < 0.0)
            low = middle;
        else
            high = middle;
    }
    *nearest = distance(high, p_n, p_e, params, &slope);
    return high;
}

static double path_closest(double p_n, double p_e, const PathParams *params)
{
    double best_s = 0.0, best = INFINITY;
    double start = params->knots[0], low = start, low_slope = -1.0;
    double step = (params->knots[1] - start) / SAMPLES_PER_PIECE;
    for (int j = 0; j <= SAMPLES_PER_PIECE; j++) {
        double high = start + j * step, high_slope, nearest;
        distance(high, p_n, p_e, params, &high_slope);
        if (low_slope < 0.0 && 0.0 <= high_slope) {
            double s = nearest_between(low, high, p_n, p_e, params, &nearest);
            if (nearest < best - CLOSER_M) {
                best_s = s;
                best = nearest;
            }
        }
        low = high;
        low_slope = high_slope;
    }
    if (low_slope < 0.0) {
        double slope;
        if (distance(low, p_n, p_e, params, &slope) < best - CLOSER_M)
            best_s = low;
    }
    return min(best_s, params->knots[1]);
}

/* --------------------------------------------------------------------------------- profile */

static inline bool is_descending(int64_t stage)
{
    return stage == GLIDING_DOWN || stage == INFLECTING_DOWN;
}

static inline bool is_gliding(int64_t stage)
{
    return stage == GLIDING_DOWN || stage == GLIDING_UP;
}

static inline double turn_lead_s(const ProfileState *state, const ProfileParams *params)
{
    double same_s = state->lead_down_s, other_s = state->lead_up_s;
    if (is_descending(state->stage)) {
        same_s = state->lead_up_s;
        other_s = state->lead_down_s;
    }
    if (same_s > 0.0)
        return same_s;
    return other_s > 0.0 ? other_s : params->lead_s;
}

static inline int64_t next_stage(
    const ProfileState *state, double depth, double vertical_rate, const ProfileParams *params)
{
    int64_t stage = state->stage;
    double lead = fabs(vertical_rate) * turn_lead_s(state, params);
    if (state->aborted)
        return depth < AT_SURFACE_M ? WAITING_ON_SURFACE : SURFACING;
    if (stage == SURFACE_PREPARATION && state->ticks >= params->prepare_ticks)
        return GLIDING_DOWN;
    if (stage == GLIDING_DOWN && depth + lead >= params->depth)
        return INFLECTING_UP;
    if (stage == INFLECTING_UP && vertical_rate < -0.05)
        return GLIDING_UP;
    if (stage == GLIDING_UP) {
        int64_t done = state->dives + 1;
        bool last = params->dives > 0 && done >= params->dives;
        if (last || (params->surface_every > 0 && done % params->surface_every == 0))
            return depth < AT_SURFACE_M ? WAITING_ON_SURFACE : GLIDING_UP;
        return depth - lead <= params->top_depth ? INFLECTING_DOWN : GLIDING_UP;
    }
    if (stage == INFLECTING_DOWN && vertical_rate > 0.05 && depth > 2.0 * AT_SURFACE_M)
        return GLIDING_DOWN;
    bool finished = params->dives > 0 && state->dives >= params->dives;
    if (stage == WAITING_ON_SURFACE && state->ticks >= params->wait_ticks && !finished)
        return SURFACE_PREPARATION;
    return stage;
}

static inline ProfileState profile_step(
    const ProfileState *state, double depth, double vertical_rate, const ProfileParams *params)
{
    int64_t stage = next_stage(state, depth, vertical_rate, params);
    double up_s = state->lead_up_s, down_s = state->lead_down_s;
    if (stage == state->stage) {
        double took_s = 2.0 / 3.0 * state->ticks * TICK_S / (1.0 - PITCH_OVER * PITCH_OVER);
        took_s = min(LEAD_RANGE * params->lead_s, took_s);
        if (stage == INFLECTING_UP && vertical_rate > PITCH_OVER * params->glide_rate)
            up_s = took_s;
        else if (stage == INFLECTING_DOWN && vertical_rate < -PITCH_OVER * params->glide_rate)
            down_s = took_s;
        return (ProfileState){
            stage, state->ticks + 1, state->dives, state->aborted, up_s, down_s};
    }
    bool climbed = state->stage == GLIDING_UP && !state->aborted;
    int64_t dives = state->dives + (climbed ? 1 : 0);
    return (ProfileState){stage, 0, dives, state->aborted, up_s, down_s};
}

/* Returns the pitch; the vertical rate goes to rate_target. */
static inline double profile_targets(
    int64_t stage, double vertical_rate, const ProfileParams *params, double *rate_target)
{
    double rate = params->glide_rate;
    bool down = is_descending(stage);
    bool nose_down = down || stage == SURFACE_PREPARATION;
    if (stage == INFLECTING_UP)
        nose_down = vertical_rate > PITCH_OVER * rate;
    else if (stage == INFLECTING_DOWN)
        nose_down = vertical_rate > -PITCH_OVER * rate;
    *rate_target = down ? rate : -rate;
    return nose_down ? -params->pitch : params->pitch;
}

static inline double time_to_turn(
    const ProfileState *state, double depth, double vertical_rate, const ProfileParams *params)
{
    double rate = max(fabs(vertical_rate), 0.01);
    if (state->stage == GLIDING_DOWN)
        return (params->depth - depth) / rate - turn_lead_s(state, params);
    int64_t done = state->dives + 1;
    bool surfacing = (params->dives > 0 && done >= params->dives)
        || (params->surface_every > 0 && done % params->surface_every == 0);
    if (state->stage == GLIDING_UP && !surfacing)
        return (depth - params->top_depth) / rate - turn_lead_s(state, params);
    return INFINITY;
}

static inline double smooth(double share)
{
    double x = min(1.0, max(0.0, share));
    return x * x * (3.0 - 2.0 * x);
}

static inline double turn_offset(
    double to_turn_s, double since_turn_s, double coming, double past)
{
    double before = smooth((LEAD_FROM_S - to_turn_s) / (LEAD_FROM_S - LEAD_TO_S));
    double after = 1.0 - smooth(since_turn_s / RETURN_S);
    return past * after - coming * before;
}

/* --------------------------------------------------------------------------- line of sight */

typedef struct { double azimuth, elevation; } Direction;

static inline Direction approach_angles(double e2, double e3, double delta_1, double delta_2)
{
    double gamma_r = -atan(e2 / delta_1);
    double rho_r = atan(e3 / (delta_2 * sqrt(e2 * e2 + delta_1 * delta_1)));
    return (Direction){gamma_r, rho_r};
}

static inline Direction desired_direction(
    double gamma_d, double rho_d, double gamma_r, double rho_r)
{
    double sgd = sin(gamma_d), cgd = cos(gamma_d);
    double srd = sin(rho_d), crd = cos(rho_d);
    double sgr = sin(gamma_r), cgr = cos(gamma_r);
    double srr = sin(rho_r), crr = cos(rho_r);
    double north = -sgd * sgr * crr - srd * srr * cgd + cgd * cgr * crd * crr;
    double east = cgd * sgr * crr - srd * srr * sgd + sgd * cgr * crd * crr;
    double up = srd * cgr * crr + crd * srr;
    return (Direction){atan2(east, north), asin(min(1.0, max(-1.0, up)))};
}

static inline double target_rate(
    double progress, double e1, double slope, double delta, double rate_max)
{
    return min(rate_max, max(0.0, (progress + delta * e1) / slope));
}

/* Returns the heading; the progress, and whether the course is feasible, go to the pointers. */
static inline double crab_heading(
    double course, double speed, double current_n, double current_e, double *progress,
    bool *feasible)
{
    double sine = sin(course), cosine = cos(course);
    double across = -sine * current_n + cosine * current_e;
    double along_course = cosine * current_n + sine * current_e;
    double ratio = across / max(speed, 1e-3);
    double held = min(1.0, max(-1.0, ratio));
    double crab = asin(held);
    *progress = speed * cos(crab) + along_course;
    *feasible = fabs(ratio) <= 1.0 && *progress > 0.0;
    return wrap_angle(course - crab);
}

static inline double approach_heading(
    double course, double approach, double progress, double speed,
    double current_n, double current_e)
{
    double across = -sin(course) * current_n + cos(course) * current_e;
    double wanted = max(0.0, progress) * sin(approach);
    double ratio = (across - wanted) / max(speed, 1e-3);
    return wrap_angle(course - asin(min(1.0, max(-1.0, ratio))));
}

/* -------------------------------------------------------------------------------- observer */

static inline ObserverState observer_step(
    ObserverState state, double ground_n, double ground_e, double model_n, double model_e,
    bool valid, ObserverParams params, double dt)
{
    double drift_n = 0.0, drift_e = 0.0;
    double current_n = state.current_n, current_e = state.current_e;
    if (valid) {
        drift_n = ground_n - model_n - state.current_n;
        drift_e = ground_e - model_e - state.current_e;
        current_n = state.current_n + dt * params.k4 * state.error_n;
        current_e = state.current_e + dt * params.k4 * state.error_e;
    }
    return (ObserverState){
        state.error_n + dt * (drift_n - params.k3 * state.error_n),
        state.error_e + dt * (drift_e - params.k3 * state.error_e),
        current_n,
        current_e,
    };
}

/* -------------------------------------------------------------------------------- guidance */

typedef struct {
    Reference reference;
    TrackingError error;
    Water current;
    int64_t stage;
    bool infeasible;
} GuidanceOutput;

static void start(
    GuidanceState *state, const Odometry *odometry, double psi, double theta,
    const GuidanceParams *params)
{
    state->s = path_closest(odometry->p_n, odometry->p_e, &params->path);
    state->profile.stage = SURFACE_PREPARATION;
    state->profile.ticks = 0;
    state->profile.lead_up_s = 0.0;
    state->profile.lead_down_s = 0.0;
    state->heading = (Filtered){psi, 0.0};
    state->pitch = (Filtered){theta, 0.0};
    state->speed = params->profile_speed;
    state->heading_command = psi;
    state->drift = 0.0;
    state->infeasible_ticks = 0;
}

static inline double lookahead_stretch(const SteeringState *steering, double lookahead_s)
{
    if (lookahead_s <= 0.0)
        return 1.0;
    double needed_s = LOOKAHEAD_OVER_ZERO / followed_frequency(steering);
    return min(LOOKAHEAD_STRETCH_MAX, max(1.0, needed_s / lookahead_s));
}

static inline double within(double value, double most)
{
    return min(most, max(-most, value));
}

static inline GuidanceOutput guidance_step(
    GuidanceState *state, const Odometry *odometry, const GuidanceParams *params, double dt)
{
    double q_w = odometry->q_w, q_x = odometry->q_x, q_y = odometry->q_y, q_z = odometry->q_z;
    Euler attitude = euler_from_quaternion(q_w, q_x, q_y, q_z);
    double theta = attitude.theta, psi = attitude.psi;
    Vector ground
        = rotate_to_ned(q_w, q_x, q_y, q_z, odometry->u, odometry->v, odometry->w);
    if (state->tick == 0)
        start(state, odometry, psi, theta, params);

    /* where the vehicle is relative to the path */
    Vector tangent = path_tangent(state->s, &params->path);
    double d_n = tangent.x, d_e = tangent.y, d_d = 0.0;
    double slope = sqrt(d_n * d_n + d_e * d_e + d_d * d_d);
    double gamma_d = atan2(d_e, d_n), rho_d = atan2(-d_d, hypot(d_n, d_e));
    TrackingError error = path_errors(
        odometry->p_n, odometry->p_e, odometry->p_d, state->s, gamma_d, rho_d, &params->path);
    error.e3 = 0.0;

    /* what the vehicle is doing */
    ProfileState profile
        = profile_step(&state->profile, odometry->p_d, ground.z, &params->profile);
    int64_t stage = profile.stage;
    double rate_target;
    double pitch_target = profile_targets(stage, ground.z, &params->profile, &rate_target);

    /* what it can follow */
    Measured measured = measure(state->measured, odometry, state->tick == 0, ATTITUDE_S, dt);
    double alpha;
    double measured_speed
        = glide_speed(measured.theta, measured.vertical_rate, &params->polar, &alpha);
    Steering steering = state->steering;
    learn(&steering, &measured, measured_speed, &params->steering, dt);
    double stretch = lookahead_stretch(&steering.dive, params->lookahead_s);
    double next_stretch = lookahead_stretch(&steering.climb, params->lookahead_s);
    if (rate_target < 0.0) {
        double other = stretch;
        stretch = next_stretch;
        next_stretch = other;
    }

    /* speed through the water and current */
    bool settled = is_gliding(stage) && profile.ticks * dt > SETTLED_S;
    bool valid = settled && fabs(theta) > MODEL_PITCH && fabs(ground.z) > MODEL_VERTICAL_RATE
        && theta * ground.z < 0.0;
    double model_speed = glide_horizontal_speed(theta, ground.z, &params->polar);
    ObserverState observer = observer_step(
        state->observer, ground.x, ground.y, model_speed * cos(psi), model_speed * sin(psi),
        valid, params->observer, dt);
    double speed = state->speed;
    if (valid)
        speed += dt / SPEED_FILTER_S * (model_speed - speed);

    bool surfaced
        = stage == WAITING_ON_SURFACE || stage == SURFACE_PREPARATION || stage == SURFACING;
    bool turns_over = !is_gliding(stage) && !surfaced;
    bool begins_to_turn_over = turns_over && is_gliding(state->profile.stage);
    if (params->compensates && begins_to_turn_over)
        speed = params->profile_speed;

    /* direction to fly */
    double lookahead_s = stretch * params->lookahead_s;
    double lookahead = max(
        params->lookahead,
        lookahead_s * sqrt(ground.x * ground.x + ground.y * ground.y));
    double drift_past = state->drift;
    double beside = state->beside + dt / BESIDE_S * (error.e2 - state->beside);
    double more_up_s = state->more_up_s, more_down_s = state->more_down_s;
    double offset = 0.0;
    bool is_nearly_over = false;
    if (params->leads) {
        double across = observer.current_e * cos(gamma_d) - observer.current_n * sin(gamma_d);
        double more_s = rate_target > 0.0 ? more_up_s : more_down_s;
        double coming = across * (turn_lead_s(&profile, &params->profile) + more_s);
        if (surfaced)
            drift_past = 0.0;
        else if (begins_to_turn_over) {
            more_s = stage == INFLECTING_UP ? more_up_s : more_down_s;
            drift_past = across * (turn_lead_s(&state->profile, &params->profile) + more_s);
        }
        if (is_gliding(stage)) {
            double to_turn_s
                = time_to_turn(&profile, odometry->p_d, ground.z, &params->profile);
            if (state->tick * dt + to_turn_s > params->end_s)
                to_turn_s = INFINITY;
            double part = next_stretch / (stretch + next_stretch);
            double glided_s = profile.ticks * dt;
            double next = part * coming, past = part * drift_past;
            offset = turn_offset(to_turn_s, glided_s, next, past);
            if (state->profile.ticks * dt < MEASURED_S && MEASURED_S <= glided_s
                && drift_past != 0.0 && fabs(across) > MEASURED_CURRENT) {
                more_s = (1.0 - 1.0 / stretch) * (beside - offset) / across;
                if (rate_target < 0.0)
                    more_up_s = within(more_up_s + more_s, LEAD_CORRECTION_S);
                else
                    more_down_s = within(more_down_s + more_s, LEAD_CORRECTION_S);
            }
            double moved = turn_offset(to_turn_s - 1.0, glided_s + 1.0, next, past) - offset;
            offset += OFFSET_AHEAD * lookahead_s * moved;
            is_nearly_over = to_turn_s < min(READY_S_MAX, READY_S * (next_stretch - 1.0));
        }
    }
    Direction relative = approach_angles(
        error.e2 - offset, error.e3, lookahead, params->vertical_ratio);
    double chi_d = desired_direction(gamma_d, rho_d, relative.azimuth, 0.0).azimuth;
    bool feasible;
    double progress;
    crab_heading(
        gamma_d, speed, observer.current_n, observer.current_e, &progress, &feasible);
    double heading_command = chi_d;
    double current_n = 0.0, current_e = 0.0;
    if (params->compensates) {
        current_n = observer.current_n;
        current_e = observer.current_e;
        heading_command = approach_heading(
            gamma_d, wrap_angle(chi_d - gamma_d), progress, speed, current_n, current_e);
    }
    int64_t infeasible_ticks = feasible ? 0 : state->infeasible_ticks + 1;
    if (params->compensates && (is_nearly_over || begins_to_turn_over)) {
        double made_good;
        bool is_feasible;
        heading_command = crab_heading(
            gamma_d, params->profile_speed, observer.current_n, observer.current_e, &made_good,
            &is_feasible);
    } else if (turns_over)
        heading_command = state->heading_command;

    /* virtual target */
    double made_good = (ground.x * d_n + ground.y * d_e + ground.z * d_d) / slope;
    double s_rate
        = target_rate(made_good, error.e1, slope, params->target_gain, TARGET_SPEED_MAX / slope);
    double s = state->s + dt * s_rate;

    double turn_rate = is_gliding(stage) ? path_turn(state->s, &params->path) * s_rate : 0.0;
    Filtered heading = filter_angle(
        state->heading, heading_command, turn_rate, params->heading_filter, dt);
    Filtered pitch = filter_angle(state->pitch, pitch_target, 0.0, params->pitch_filter, dt);
    Vector target = path_point(state->s, &params->path);

    GuidanceOutput output = {
        {
            target.x,
            target.y,
            rate_target > 0.0 ? params->profile.depth : 0.0,
            0.0,
            pitch.value,
            heading.value,
            cos(heading_command) * speed + current_n,
            sin(heading_command) * speed + current_e,
            rate_target,
            0.0,
            pitch.rate,
            heading.rate,
        },
        error,
        {observer.current_n, observer.current_e, 0.0},
        stage,
        infeasible_ticks * dt > INFEASIBLE_S,
    };
    *state = (GuidanceState){
        state->tick + 1, profile, s, observer, heading, pitch, speed, heading_command,
        drift_past, infeasible_ticks, beside, more_up_s, more_down_s, measured, steering,
    };
    return output;
}
