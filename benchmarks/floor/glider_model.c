/* Copyright 2026 The glider stack authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * glider_model in C99: frames, polar, command filter, water, rigid body, hydrodynamics, plant,
 * measurement, steering.
 * The names and the order of every operation are those of the Python.
 * Left out: sensor noise, and every current but the constant one.
 */

/* ------------------------------------------------------------------------------- builtins */

/* Python's min and max: the first argument, unless the second one is beyond it. */
static inline double min(double a, double b) { return b < a ? b : a; }
static inline double max(double a, double b) { return b > a ? b : a; }

typedef struct { double x, y, z; } Vector;
typedef struct { double w, x, y, z; } Quaternion;
typedef struct { double phi, theta, psi; } Euler;
typedef struct { double f_x, f_y, f_z, t_x, t_y, t_z; } Force;

/* --------------------------------------------------------------------------------- frames */

static inline double wrap_angle(double angle)
{
    return angle - 2.0 * PI * floor((angle + PI) / (2.0 * PI));
}

static inline Vector rotate_to_ned(
    double q_w, double q_x, double q_y, double q_z, double x, double y, double z)
{
    double t_x = 2.0 * (q_y * z - q_z * y);
    double t_y = 2.0 * (q_z * x - q_x * z);
    double t_z = 2.0 * (q_x * y - q_y * x);
    return (Vector){
        x + q_w * t_x + q_y * t_z - q_z * t_y,
        y + q_w * t_y + q_z * t_x - q_x * t_z,
        z + q_w * t_z + q_x * t_y - q_y * t_x,
    };
}

static inline Vector rotate_to_body(
    double q_w, double q_x, double q_y, double q_z, double x, double y, double z)
{
    return rotate_to_ned(q_w, -q_x, -q_y, -q_z, x, y, z);
}

static inline Quaternion quaternion_from_euler(double phi, double theta, double psi)
{
    double c1 = cos(0.5 * phi), s1 = sin(0.5 * phi);
    double c2 = cos(0.5 * theta), s2 = sin(0.5 * theta);
    double c3 = cos(0.5 * psi), s3 = sin(0.5 * psi);
    return (Quaternion){
        c1 * c2 * c3 + s1 * s2 * s3,
        s1 * c2 * c3 - c1 * s2 * s3,
        c1 * s2 * c3 + s1 * c2 * s3,
        c1 * c2 * s3 - s1 * s2 * c3,
    };
}

static inline Euler euler_from_quaternion(double q_w, double q_x, double q_y, double q_z)
{
    double phi = atan2(2.0 * (q_w * q_x + q_y * q_z), 1.0 - 2.0 * (q_x * q_x + q_y * q_y));
    double sine = 2.0 * (q_w * q_y - q_z * q_x);
    double theta = asin(min(1.0, max(-1.0, sine)));
    double psi = atan2(2.0 * (q_w * q_z + q_x * q_y), 1.0 - 2.0 * (q_y * q_y + q_z * q_z));
    return (Euler){phi, theta, psi};
}

static inline Quaternion swap_world(double q_w, double q_x, double q_y, double q_z)
{
    double w = HALF_SQRT2 * (q_w + q_z);
    double x = HALF_SQRT2 * (q_x + q_y);
    double y = HALF_SQRT2 * (q_x - q_y);
    double z = HALF_SQRT2 * (q_w - q_z);
    if (w < 0.0)
        return (Quaternion){-w, -x, -y, -z};
    return (Quaternion){w, x, y, z};
}

static inline void odometry_to_wire(const Odometry *odometry, double wire[13])
{
    Quaternion q = swap_world(odometry->q_w, odometry->q_x, odometry->q_y, odometry->q_z);
    wire[0] = odometry->p_e;
    wire[1] = odometry->p_n;
    wire[2] = -odometry->p_d;
    wire[3] = q.w;
    wire[4] = q.x;
    wire[5] = q.y;
    wire[6] = q.z;
    wire[7] = odometry->u;
    wire[8] = -odometry->v;
    wire[9] = -odometry->w;
    wire[10] = odometry->p;
    wire[11] = -odometry->q;
    wire[12] = -odometry->r;
}

static inline Odometry odometry_from_wire(const double wire[13])
{
    Quaternion q = swap_world(wire[3], wire[4], wire[5], wire[6]);
    return (Odometry){
        wire[1], wire[0], -wire[2], q.w, q.x, q.y, q.z,
        wire[7], -wire[8], -wire[9], wire[10], -wire[11], -wire[12],
    };
}

static inline void reference_to_wire(const Reference *reference, double wire[13])
{
    Quaternion q = quaternion_from_euler(reference->phi, reference->theta, reference->psi);
    q = swap_world(q.w, q.x, q.y, q.z);
    wire[0] = reference->p_e;
    wire[1] = reference->p_n;
    wire[2] = -reference->p_d;
    wire[3] = q.w;
    wire[4] = q.x;
    wire[5] = q.y;
    wire[6] = q.z;
    wire[7] = reference->v_e;
    wire[8] = reference->v_n;
    wire[9] = -reference->v_d;
    wire[10] = reference->phi_dot;
    wire[11] = -reference->theta_dot;
    wire[12] = -reference->psi_dot;
}

static inline Reference reference_from_wire(const double wire[13])
{
    Quaternion q = swap_world(wire[3], wire[4], wire[5], wire[6]);
    Euler attitude = euler_from_quaternion(q.w, q.x, q.y, q.z);
    return (Reference){
        wire[1], wire[0], -wire[2], attitude.phi, attitude.theta, attitude.psi,
        wire[8], wire[7], -wire[9], wire[10], -wire[11], -wire[12],
    };
}

static inline void water_to_wire(const Water *water, double wire[3])
{
    wire[0] = water->v_e;
    wire[1] = water->v_n;
    wire[2] = -water->v_d;
}

static inline Water water_from_wire(const double wire[3])
{
    return (Water){wire[1], wire[0], -wire[2]};
}

static inline void wrench_to_wire(const Wrench *wrench, double wire[3])
{
    wire[0] = -wrench->tau_w;
    wire[1] = wrench->tau_p;
    wire[2] = -wrench->tau_q;
}

/* -------------------------------------------------------------------------- command filter */

static inline double clip(double number, double limit)
{
    return min(limit, max(-limit, number));
}

static inline Filtered filter_error(
    Filtered state, double error, double command_rate, FilterParams params, double dt)
{
    double pull = clip(0.5 * params.frequency * error + command_rate, params.rate_limit);
    double rate = state.rate + dt * 2.0 * params.frequency * (pull - state.rate);
    return (Filtered){state.value + dt * rate, rate};
}

static inline Filtered filter_command(
    Filtered state, double command, FilterParams params, double dt)
{
    return filter_error(state, command - state.value, 0.0, params, dt);
}

static inline Filtered filter_angle(
    Filtered state, double command, double command_rate, FilterParams params, double dt)
{
    Filtered moved
        = filter_error(state, wrap_angle(command - state.value), command_rate, params, dt);
    return (Filtered){wrap_angle(moved.value), moved.rate};
}

/* ----------------------------------------------------------------------------------- polar */

static inline double glide_alpha(double theta, const Polar *polar)
{
    double drag = polar->K_D0 / polar->K_D, offset = polar->K_L0 / polar->K_D;
    double lift = 0.5 * polar->K_L / polar->K_D;
    double alpha = 0.0;
    for (int i = 0; i < 4; i++) {
        double slope = tan(theta - alpha);
        double half = lift * slope;
        double root = half * half - (drag + offset * slope);
        alpha = -half;
        if (root > 0.0)
            alpha += half > 0.0 ? sqrt(root) : -sqrt(root);
        alpha = min(LARGEST_ALPHA, max(-LARGEST_ALPHA, alpha));
    }
    return alpha;
}

static inline double steepen(double theta)
{
    if (theta < 0.0)
        return min(theta, -SHALLOWEST_PITCH);
    return max(theta, SHALLOWEST_PITCH);
}

static inline double glide_force(double alpha, const Polar *polar)
{
    double drag = polar->K_D0 + polar->K_D * alpha * alpha;
    double lift = polar->K_L0 + polar->K_L * alpha;
    return sqrt(drag * drag + lift * lift);
}

static inline double glide_net_heaviness(
    double theta, double vertical_rate, const Polar *polar)
{
    double steep = vertical_rate >= 0.0 ? -fabs(steepen(theta)) : fabs(steepen(theta));
    double alpha = glide_alpha(steep, polar);
    double speed = vertical_rate / sin(steep - alpha);
    double weight = glide_force(alpha, polar) * speed * speed / GRAVITY;
    return vertical_rate >= 0.0 ? weight : -weight;
}

static inline double glide_horizontal_speed(
    double theta, double vertical_rate, const Polar *polar)
{
    double steep = steepen(theta);
    return fabs(vertical_rate / tan(steep - glide_alpha(steep, polar)));
}

/* Returns the speed; the angle of attack goes to alpha. */
static inline double glide_speed(
    double theta, double vertical_rate, const Polar *polar, double *alpha)
{
    double steep = steepen(theta);
    *alpha = glide_alpha(steep, polar);
    return fabs(vertical_rate / sin(steep - *alpha));
}

/* --------------------------------------------------------------------------------- current */

static inline Water current_step(CurrentState *state, const CurrentParams *params)
{
    state->tick += 1;
    return (Water){0.0 + params->numbers[0], 0.0 + params->numbers[1], 0.0};
}

/* ----------------------------------------------------------------------------------- water */

static inline double buoyancy_gain(double depth, double mass, const WaterParams *water)
{
    double z = max(depth, 0.0);
    double rise = 0.0;
    if (water->rise > 0.0)
        rise = water->rise * (1.0 - exp(-z * water->inverse_depth));
    return mass * (rise + water->net_compression * z);
}

static inline double emerged_fraction(double depth, double radius)
{
    if (depth >= radius)
        return 0.0;
    double out = min(1.0, (radius - depth) / (2.0 * radius));
    return out * out * (3.0 - 2.0 * out);
}

/* ------------------------------------------------------------------------------- actuators */

static inline double toward(double position, double target, double limit, double reach)
{
    double goal = min(limit, max(-limit, target));
    return position + min(reach, max(-reach, goal - position));
}

static inline Joints actuators_step(
    Joints joints, Joints command, const VehicleParams *vehicle, double dt)
{
    return (Joints){
        toward(joints.m_b, command.m_b, vehicle->m_b_max, vehicle->m_b_rate * dt),
        toward(joints.x_p, command.x_p, vehicle->x_p_max, vehicle->x_p_rate * dt),
        toward(joints.mu, command.mu, vehicle->mu_max, vehicle->mu_rate * dt),
    };
}

/* ------------------------------------------------------------------------------ rigid body */

typedef struct {
    double s_x, s_y, s_z;
    double i_xx, i_yy, i_zz, i_xy, i_xz, i_yz;
    double n_xx, n_yy, n_zz, n_xy, n_xz, n_yz;
} Inertia;

static inline Inertia rigid_body(double x_p, double mu, const VehicleParams *vehicle)
{
    double x = vehicle->x_p0 + x_p;
    double sine = sin(mu), cosine = cos(mu);
    double y = vehicle->R_p * sine, z = vehicle->R_p * cosine;
    double m_p = vehicle->m_p;
    return (Inertia){
        .s_x = vehicle->s_x + m_p * x,
        .s_y = vehicle->s_y + m_p * y,
        .s_z = vehicle->s_z + m_p * z,
        .i_xx = vehicle->i_xx + vehicle->i_px + m_p * (y * y + z * z),
        .i_yy = vehicle->i_yy + cosine * cosine * vehicle->i_py + sine * sine * vehicle->i_pz
            + m_p * (x * x + z * z),
        .i_zz = vehicle->i_zz + sine * sine * vehicle->i_py + cosine * cosine * vehicle->i_pz
            + m_p * (x * x + y * y),
        .i_xy = -m_p * x * y,
        .i_xz = -m_p * x * z,
        .i_yz = (vehicle->i_pz - vehicle->i_py) * sine * cosine - m_p * y * z,
    };
}

static inline Inertia make_inertia(double x_p, double mu, const VehicleParams *vehicle)
{
    Inertia inertia = rigid_body(x_p, mu, vehicle);
    double s_x = inertia.s_x, s_y = inertia.s_y, s_z = inertia.s_z;
    double a_1 = 1.0 / (vehicle->m + vehicle->a_11);
    double a_2 = 1.0 / (vehicle->m + vehicle->a_22);
    double a_3 = 1.0 / (vehicle->m + vehicle->a_33);
    double b_23 = s_x + vehicle->a_26;
    double b_32 = -s_x + vehicle->a_35;
    double d_xx = inertia.i_xx + vehicle->a_44 - a_2 * s_z * s_z - a_3 * s_y * s_y;
    double d_yy = inertia.i_yy + vehicle->a_55 - a_1 * s_z * s_z - a_3 * b_32 * b_32;
    double d_zz = inertia.i_zz + vehicle->a_66 - a_1 * s_y * s_y - a_2 * b_23 * b_23;
    double d_xy = inertia.i_xy - a_3 * s_y * b_32;
    double d_xz = inertia.i_xz + a_2 * s_z * b_23;
    double d_yz = inertia.i_yz + a_1 * s_z * s_y;
    double c_xx = d_yy * d_zz - d_yz * d_yz;
    double c_xy = d_xz * d_yz - d_xy * d_zz;
    double c_xz = d_xy * d_yz - d_xz * d_yy;
    double scale = 1.0 / (d_xx * c_xx + d_xy * c_xy + d_xz * c_xz);
    inertia.n_xx = c_xx * scale;
    inertia.n_yy = (d_xx * d_zz - d_xz * d_xz) * scale;
    inertia.n_zz = (d_xx * d_yy - d_xy * d_xy) * scale;
    inertia.n_xy = c_xy * scale;
    inertia.n_xz = c_xz * scale;
    inertia.n_yz = (d_xz * d_xy - d_xx * d_yz) * scale;
    return inertia;
}

static inline Force solve_mass(
    double f_x, double f_y, double f_z, double t_x, double t_y, double t_z,
    const Inertia *inertia, const VehicleParams *vehicle)
{
    double s_x = inertia->s_x, s_y = inertia->s_y, s_z = inertia->s_z;
    double b_23 = s_x + vehicle->a_26;
    double b_32 = -s_x + vehicle->a_35;
    double a_1 = 1.0 / (vehicle->m + vehicle->a_11);
    double a_2 = 1.0 / (vehicle->m + vehicle->a_22);
    double a_3 = 1.0 / (vehicle->m + vehicle->a_33);
    double g_x = a_1 * f_x, g_y = a_2 * f_y, g_z = a_3 * f_z;
    double h_x = t_x + s_z * g_y - s_y * g_z;
    double h_y = t_y - s_z * g_x - b_32 * g_z;
    double h_z = t_z + s_y * g_x - b_23 * g_y;
    double w_x = inertia->n_xx * h_x + inertia->n_xy * h_y + inertia->n_xz * h_z;
    double w_y = inertia->n_xy * h_x + inertia->n_yy * h_y + inertia->n_yz * h_z;
    double w_z = inertia->n_xz * h_x + inertia->n_yz * h_y + inertia->n_zz * h_z;
    return (Force){
        g_x - a_1 * (s_z * w_y - s_y * w_z),
        g_y - a_2 * (-s_z * w_x + b_23 * w_z),
        g_z - a_3 * (s_y * w_x + b_32 * w_y),
        w_x,
        w_y,
        w_z,
    };
}

static inline Force coriolis(
    double u, double v, double w, double p, double q, double r,
    const Inertia *inertia, const VehicleParams *vehicle)
{
    double m = vehicle->m;
    double s_x = inertia->s_x, s_y = inertia->s_y, s_z = inertia->s_z;
    double c_x = q * w - r * v, c_y = r * u - p * w, c_z = p * v - q * u;
    double e_x = q * s_z - r * s_y, e_y = r * s_x - p * s_z, e_z = p * s_y - q * s_x;
    double h_x = inertia->i_xx * p + inertia->i_xy * q + inertia->i_xz * r;
    double h_y = inertia->i_xy * p + inertia->i_yy * q + inertia->i_yz * r;
    double h_z = inertia->i_xz * p + inertia->i_yz * q + inertia->i_zz * r;
    double a_x = vehicle->a_11 * u;
    double a_y = vehicle->a_22 * v + vehicle->a_26 * r;
    double a_z = vehicle->a_33 * w + vehicle->a_35 * q;
    h_x += vehicle->a_44 * p;
    h_y += vehicle->a_55 * q + vehicle->a_35 * w;
    h_z += vehicle->a_66 * r + vehicle->a_26 * v;
    return (Force){
        m * c_x + q * e_z - r * e_y + q * a_z - r * a_y,
        m * c_y + r * e_x - p * e_z + r * a_x - p * a_z,
        m * c_z + p * e_y - q * e_x + p * a_y - q * a_x,
        s_y * c_z - s_z * c_y + q * h_z - r * h_y + v * a_z - w * a_y,
        s_z * c_x - s_x * c_z + r * h_x - p * h_z + w * a_x - u * a_z,
        s_x * c_y - s_y * c_x + p * h_y - q * h_x + u * a_y - v * a_x,
    };
}

/* --------------------------------------------------------------------------- hydrodynamics */

static inline Force hydrodynamics(
    double u, double v, double w, double p, double q, double r, const VehicleParams *vehicle)
{
    double xz2 = u * u + w * w;
    double speed2 = xz2 + v * v;
    double speed = sqrt(speed2);
    double xz = sqrt(xz2);
    double f_x = 0.0, f_y = 0.0, f_z = 0.0;
    double t_x = 0.0, t_y = 0.0, t_z = 0.0;
    if (xz > 1e-9) {
        double c_a = u / xz, s_a = w / xz;
        double c_b = xz / speed, s_b = v / speed;
        double lift_angle = s_a * c_a;
        double drag = (vehicle->K_D0 + vehicle->K_D * s_a * s_a) * speed2;
        double side = vehicle->K_beta * s_b * speed2;
        double lift = (vehicle->K_L0 + vehicle->K_L * lift_angle) * speed2;
        double s_d = s_a * c_a * c_a * c_a * c_a;
        double c_d = sqrt(1.0 - s_d * s_d);
        double damp_1 = vehicle->K_p * (c_d * p + s_d * r) * speed2;
        double damp_2 = vehicle->K_q * q * speed2;
        double damp_3 = vehicle->K_r * (c_d * r - s_d * p) * speed2;
        double m_1 = vehicle->K_MR * s_b * speed2;
        double m_2 = (vehicle->K_M0 + vehicle->K_M * lift_angle) * speed2;
        double m_3 = vehicle->K_MY * s_b * speed2;
        f_x = -drag * c_a * c_b - side * c_a * s_b + lift * s_a;
        f_y = -drag * s_b + side * c_b;
        f_z = -drag * s_a * c_b - side * s_a * s_b - lift * c_a;
        t_x = m_1 * c_a * c_b - m_2 * c_a * s_b - m_3 * s_a + c_d * damp_1 - s_d * damp_3;
        t_y = m_1 * s_b + m_2 * c_b + damp_2;
        t_z = m_1 * s_a * c_b - m_2 * s_a * s_b + m_3 * c_a + s_d * damp_1 + c_d * damp_3;
    }
    return (Force){
        f_x - (vehicle->D_u + vehicle->D_uu * fabs(u)) * u,
        f_y - (vehicle->D_v + vehicle->D_vv * fabs(v)) * v,
        f_z - (vehicle->D_w + vehicle->D_ww * fabs(w)) * w,
        t_x - (vehicle->D_p + vehicle->D_pp * fabs(p)) * p,
        t_y - (vehicle->D_q + vehicle->D_qq * fabs(q)) * q,
        t_z - (vehicle->D_r + vehicle->D_rr * fabs(r)) * r,
    };
}

/* ----------------------------------------------------------------------------------- plant */

static inline double surface_damping(const Motion *motion, const VehicleParams *vehicle)
{
    double down = rotate_to_ned(
        motion->q_w, motion->q_x, motion->q_y, motion->q_z, motion->u, motion->v, motion->w).z;
    double mass = vehicle->m + vehicle->a_33;
    double stiffness = vehicle->m * GRAVITY / (2.0 * vehicle->hull_radius);
    double depth_share = min(1.0, (vehicle->hull_radius - motion->p_d) / vehicle->hull_radius);
    return 2.0 * SURFACE_DAMPING * sqrt(stiffness * mass) * down * depth_share;
}

static inline Force acceleration(
    const Motion *motion, double m_b, const Inertia *inertia, const Water *water_rate,
    const VehicleParams *vehicle, const WaterParams *water)
{
    double q_w = motion->q_w, q_x = motion->q_x, q_y = motion->q_y, q_z = motion->q_z;
    double u = motion->u, v = motion->v, w = motion->w;
    double p = motion->p, q = motion->q, r = motion->r;
    Force h = hydrodynamics(u, v, w, p, q, r, vehicle);
    Force c = coriolis(u, v, w, p, q, r, inertia, vehicle);
    double k_x = 2.0 * (q_x * q_z - q_w * q_y);
    double k_y = 2.0 * (q_y * q_z + q_w * q_x);
    double k_z = 1.0 - 2.0 * (q_x * q_x + q_y * q_y);
    double s_x = inertia->s_x, s_y = inertia->s_y, s_z = inertia->s_z;
    double weight
        = (m_b + vehicle->ballast - buoyancy_gain(motion->p_d, vehicle->m, water)) * GRAVITY;
    if (motion->p_d < vehicle->hull_radius)
        weight += (vehicle->m * GRAVITY * emerged_fraction(motion->p_d, vehicle->hull_radius))
            - surface_damping(motion, vehicle);
    Vector a = {0.0, 0.0, 0.0};
    if (water_rate->v_n != 0.0 || water_rate->v_e != 0.0 || water_rate->v_d != 0.0)
        a = rotate_to_body(
            q_w, q_x, q_y, q_z, water_rate->v_n, water_rate->v_e, water_rate->v_d);
    double m = vehicle->m;
    return solve_mass(
        h.f_x - c.f_x + weight * k_x - m * a.x,
        h.f_y - c.f_y + weight * k_y - m * a.y,
        h.f_z - c.f_z + weight * k_z - m * a.z,
        h.t_x - c.t_x + GRAVITY * (s_y * k_z - s_z * k_y) - (s_y * a.z - s_z * a.y),
        h.t_y - c.t_y + GRAVITY * (s_z * k_x - s_x * k_z) - (s_z * a.x - s_x * a.z),
        h.t_z - c.t_z + GRAVITY * (s_x * k_y - s_y * k_x) - (s_x * a.y - s_y * a.x),
        inertia,
        vehicle);
}

static inline Motion derivative(
    const Motion *motion, double m_b, const Inertia *inertia, const Water *current,
    const Water *water_rate, const VehicleParams *vehicle, const WaterParams *water)
{
    double q_w = motion->q_w, q_x = motion->q_x, q_y = motion->q_y, q_z = motion->q_z;
    double p = motion->p, q = motion->q, r = motion->r;
    Vector d = rotate_to_ned(q_w, q_x, q_y, q_z, motion->u, motion->v, motion->w);
    Force a = acceleration(motion, m_b, inertia, water_rate, vehicle, water);
    return (Motion){
        d.x + current->v_n,
        d.y + current->v_e,
        d.z + current->v_d,
        0.5 * (-q_x * p - q_y * q - q_z * r),
        0.5 * (q_w * p + q_y * r - q_z * q),
        0.5 * (q_w * q + q_z * p - q_x * r),
        0.5 * (q_w * r + q_x * q - q_y * p),
        a.f_x,
        a.f_y,
        a.f_z,
        a.t_x,
        a.t_y,
        a.t_z,
    };
}

static inline Motion along(const Motion *x, double h, const Motion *k)
{
    return (Motion){
        x->p_n + h * k->p_n,
        x->p_e + h * k->p_e,
        x->p_d + h * k->p_d,
        x->q_w + h * k->q_w,
        x->q_x + h * k->q_x,
        x->q_y + h * k->q_y,
        x->q_z + h * k->q_z,
        x->u + h * k->u,
        x->v + h * k->v,
        x->w + h * k->w,
        x->p + h * k->p,
        x->q + h * k->q,
        x->r + h * k->r,
    };
}

static inline Joints between(Joints start, Joints end, double share)
{
    return (Joints){
        start.m_b + share * (end.m_b - start.m_b),
        start.x_p + share * (end.x_p - start.x_p),
        start.mu + share * (end.mu - start.mu),
    };
}

static inline Motion integrate(
    Motion motion, Joints start, Joints end, const Water *current, const Water *water_rate,
    const PlantParams *params, double dt, int substeps)
{
    const VehicleParams *vehicle = &params->vehicle;
    const WaterParams *water = &params->water;
    double h = dt / substeps;
    bool fixed = start.x_p == end.x_p && start.mu == end.mu;
    Joints now = start;
    Inertia inertia_now = make_inertia(now.x_p, now.mu, vehicle);
    Motion x = motion;
    for (int i = 0; i < substeps; i++) {
        Joints middle = between(start, end, (i + 0.5) / substeps);
        Joints after = between(start, end, (i + 1.0) / substeps);
        Inertia inertia_middle = inertia_now, inertia_after = inertia_now;
        if (!fixed) {
            inertia_middle = make_inertia(middle.x_p, middle.mu, vehicle);
            inertia_after = make_inertia(after.x_p, after.mu, vehicle);
        }
        Motion k_1 = derivative(&x, now.m_b, &inertia_now, current, water_rate, vehicle, water);
        Motion x_2 = along(&x, 0.5 * h, &k_1);
        Motion k_2
            = derivative(&x_2, middle.m_b, &inertia_middle, current, water_rate, vehicle, water);
        Motion x_3 = along(&x, 0.5 * h, &k_2);
        Motion k_3
            = derivative(&x_3, middle.m_b, &inertia_middle, current, water_rate, vehicle, water);
        Motion x_4 = along(&x, h, &k_3);
        Motion k_4
            = derivative(&x_4, after.m_b, &inertia_after, current, water_rate, vehicle, water);
        x = along(&x, h / 6.0, &k_1);
        x = along(&x, h / 3.0, &k_2);
        x = along(&x, h / 3.0, &k_3);
        x = along(&x, h / 6.0, &k_4);
        now = after;
        inertia_now = inertia_after;
    }
    double norm = sqrt(x.q_w * x.q_w + x.q_x * x.q_x + x.q_y * x.q_y + x.q_z * x.q_z);
    x.q_w = x.q_w / norm;
    x.q_x = x.q_x / norm;
    x.q_y = x.q_y / norm;
    x.q_z = x.q_z / norm;
    return x;
}

static void plant_step(
    PlantState *state, Joints command, Water water, const PlantParams *params, double dt)
{
    Joints joints = actuators_step(state->joints, command, &params->vehicle, dt);
    Water water_rate = {0.0, 0.0, 0.0};
    if (state->tick > 0)
        water_rate = (Water){
            (water.v_n - state->water.v_n) / dt,
            (water.v_e - state->water.v_e) / dt,
            (water.v_d - state->water.v_d) / dt,
        };
    Motion motion = integrate(
        state->motion, state->joints, joints, &water, &water_rate, params, dt, SUBSTEPS);
    bool deep = motion.p_d > DIVE_BELOW_M || (state->deep && motion.p_d >= DIVE_ABOVE_M);
    int64_t dives = state->deep && !deep ? state->dives + 1 : state->dives;
    int64_t surface_ticks = motion.p_d < SURFACE_M ? state->surface_ticks + 1 : 0;
    *state = (PlantState){motion, joints, water, state->tick + 1, deep, dives, surface_ticks};
}

static inline bool plant_finished(const PlantState *state, const PlantParams *params)
{
    bool surfaced = params->stop_after_dives > 0 && state->dives >= params->stop_after_dives
        && state->surface_ticks >= params->stop_surface_ticks;
    return state->tick + 1 >= params->max_ticks || surfaced;
}

static inline Odometry plant_odometry(const PlantState *state)
{
    Motion x = state->motion;
    Water water = state->water;
    Vector add = rotate_to_body(
        x.q_w, x.q_x, x.q_y, x.q_z, water.v_n, water.v_e, water.v_d);
    return (Odometry){
        x.p_n, x.p_e, x.p_d, x.q_w, x.q_x, x.q_y, x.q_z,
        x.u + add.x, x.v + add.y, x.w + add.z, x.p, x.q, x.r,
    };
}

/* ----------------------------------------------------------------------------- measurement */

static inline double follow(double state, double measured, double rate, double share, double dt)
{
    double predicted = state + dt * rate;
    return wrap_angle(predicted + share * wrap_angle(measured - predicted));
}

static inline Measured measure(
    Measured state, const Odometry *odometry, bool first, double time_constant, double dt)
{
    double q_w = odometry->q_w, q_x = odometry->q_x, q_y = odometry->q_y, q_z = odometry->q_z;
    Euler attitude = euler_from_quaternion(q_w, q_x, q_y, q_z);
    double phi = attitude.phi, theta = attitude.theta, psi = attitude.psi;
    double down
        = rotate_to_ned(q_w, q_x, q_y, q_z, odometry->u, odometry->v, odometry->w).z;
    double p = odometry->p, q = odometry->q, r = odometry->r;
    double s_phi = sin(phi), c_phi = cos(phi);
    double c_theta = max(0.1, cos(theta));
    double psi_dot = (s_phi * q + c_phi * r) / c_theta;
    double theta_dot = c_phi * q - s_phi * r;
    double phi_dot = p + sin(theta) * psi_dot;
    if (first)
        return (Measured){phi, theta, psi, phi_dot, theta_dot, psi_dot, down};
    double share = dt / (time_constant + dt);
    double fast = dt / (0.25 * time_constant + dt);
    return (Measured){
        follow(state.phi, phi, phi_dot, share, dt),
        follow(state.theta, theta, theta_dot, share, dt),
        follow(state.psi, psi, psi_dot, share, dt),
        state.phi_dot + fast * (phi_dot - state.phi_dot),
        state.theta_dot + fast * (theta_dot - state.theta_dot),
        state.psi_dot + fast * (psi_dot - state.psi_dot),
        state.vertical_rate + fast * (down - state.vertical_rate),
    };
}

/* -------------------------------------------------------------------------------- steering */

static inline double speed_ratio(double speed)
{
    return max(speed, LEARN_SPEED) / STEERING_SPEED;
}

static inline bool is_to_be_kicked(const SteeringState *state, double bank)
{
    const double *p = state->p;
    double square = bank * bank;
    double against = state->b + square * state->c;
    double variance = p[0] + 2.0 * square * p[1] + square * square * p[4];
    if (against * against + variance > STRONG_STEERING * STRONG_STEERING)
        return false;
    if (state->k > 0.0)
        against = -against;
    if (state->b * state->k > 0.0 && p[0] < state->b * state->b)
        return false;
    double std = sqrt(max(0.0, variance));
    double doubt = std < WELL_KNOWN ? NO_DIFFERENCE * std : std;
    if (fabs(against) > doubt)
        return against < 0.0;
    return state->is_kicked || p[0] > state->b * state->b;
}

static inline SteeringState learn_steering(
    const SteeringState *state, double bank, double bend, double roll_rate, double yaw_rate,
    const SteeringParams *params, double dt)
{
    const double *p = state->p;
    double bb = p[0], bc = p[1], bk = p[2], bd = p[3];
    double cc = p[4], ck = p[5], cd = p[6], kk = p[7], kd = p[8], dd = p[9];
    bb += params->drift * dt;
    cc += params->bend_drift * dt;
    kk += params->kick_drift * dt;
    dd += params->disturbance_drift * dt;
    double g_b = bb * bank + bc * bend + bk * roll_rate + bd;
    double g_c = bc * bank + cc * bend + ck * roll_rate + cd;
    double g_k = bk * bank + ck * bend + kk * roll_rate + kd;
    double g_d = bd * bank + cd * bend + kd * roll_rate + dd;
    double spread = g_b * bank + g_c * bend + g_k * roll_rate + g_d + params->noise / dt;
    double gain
        = (yaw_rate - state->b * bank - state->c * bend - state->k * roll_rate - state->d)
        / spread;
    return (SteeringState){
        state->b + g_b * gain,
        state->c + g_c * gain,
        state->k + g_k * gain,
        state->d + g_d * gain,
        {
            bb - g_b * g_b / spread,
            bc - g_b * g_c / spread,
            bk - g_b * g_k / spread,
            bd - g_b * g_d / spread,
            cc - g_c * g_c / spread,
            ck - g_c * g_k / spread,
            cd - g_c * g_d / spread,
            kk - g_k * g_k / spread,
            kd - g_k * g_d / spread,
            dd - g_d * g_d / spread,
        },
        state->is_kicked,
        state->kept_s + dt,
    };
}

static inline void choose_steering(SteeringState *state, double sine, double bank)
{
    bool is_kicked = is_to_be_kicked(state, bank);
    bool is_enough = state->is_kicked && fabs(sine) < AT_LIMIT * bank;
    if (is_kicked == state->is_kicked || is_enough || state->kept_s < KEPT_S)
        return;
    state->is_kicked = is_kicked;
    state->kept_s = 0.0;
}

static inline double followed_frequency(const SteeringState *state)
{
    double frequency
        = sqrt(state->b * state->b + state->p[0]) / max(fabs(state->k), SMALLEST_KICK);
    if (state->is_kicked || state->b * state->k > 0.0)
        return max(KICKED_FREQUENCY, frequency);
    return frequency;
}

static inline void learn(
    Steering *steering, const Measured *measured, double speed, const SteeringParams *params,
    double dt)
{
    double ratio = speed_ratio(speed);
    bool is_gliding = fabs(measured->vertical_rate) > LEARN_VERTICAL_RATE && speed > LEARN_SPEED;
    double steady_s = is_gliding ? steering->steady_s + dt : 0.0;
    double share = steady_s > dt ? dt / (params->smoothing_s + dt) : 1.0;
    double sine = sin(measured->phi);
    double bank = steering->bank + share * (sine * ratio - steering->bank);
    double bend = steering->bend + share * (sine * sine * sine * ratio - steering->bend);
    double roll_rate = steering->roll_rate + share * (measured->phi_dot - steering->roll_rate);
    double yaw_rate = steering->yaw_rate + share * (measured->psi_dot - steering->yaw_rate);
    if (steady_s > params->after_s) {
        SteeringState *phase
            = measured->vertical_rate > 0.0 ? &steering->dive : &steering->climb;
        *phase = learn_steering(phase, bank, bend, roll_rate, yaw_rate, params, dt);
        choose_steering(phase, bank / ratio, params->bank);
    }
    steering->bank = bank;
    steering->bend = bend;
    steering->roll_rate = roll_rate;
    steering->yaw_rate = yaw_rate;
    steering->steady_s = steady_s;
}
