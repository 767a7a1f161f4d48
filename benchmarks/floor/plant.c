/* Copyright 2026 The glider stack authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * The floor: what the plant costs a C compiler. One translation unit, so that it may inline.
 *
 * names.h is generated from the Python (floor.py): the NamedTuples as structs, the constants of
 * the modules as macros. The names and the order of every operation are those of the Python.
 */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

/* As the kernels are. */
#define inline inline __attribute__((always_inline))

#include "names.h"

/* ------------------------------------------------------------------------------- builtins */

/* Python's min and max: the first argument, unless the second one is beyond it. */
static inline double min(double a, double b) { return b < a ? b : a; }
static inline double max(double a, double b) { return b > a ? b : a; }

typedef struct { double x, y, z; } Triple;
typedef struct { double f_x, f_y, f_z, t_x, t_y, t_z; } Force;

/* --------------------------------------------------------------------------------- frames */

static inline Triple rotate_to_ned(
    double q_w, double q_x, double q_y, double q_z, double x, double y, double z)
{
    double t_x = 2.0 * (q_y * z - q_z * y);
    double t_y = 2.0 * (q_z * x - q_x * z);
    double t_z = 2.0 * (q_x * y - q_y * x);
    return (Triple){
        x + q_w * t_x + q_y * t_z - q_z * t_y,
        y + q_w * t_y + q_z * t_x - q_x * t_z,
        z + q_w * t_z + q_x * t_y - q_y * t_x,
    };
}

static inline Triple rotate_to_body(
    double q_w, double q_x, double q_y, double q_z, double x, double y, double z)
{
    return rotate_to_ned(q_w, -q_x, -q_y, -q_z, x, y, z);
}

/* ----------------------------------------------------------------------------------- density */

static inline double buoyancy_gain(double depth, double mass, const DensityParams *density)
{
    double z = max(depth, 0.0);
    double rise = 0.0;
    if (density->rise > 0.0)
        rise = density->rise * (1.0 - exp(-z * density->inverse_depth));
    return mass * (rise + density->net_compression * z);
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

static inline double body_damping(double linear, double quadratic, double rate, double inertia)
{
    double damping = max(0.0, linear + quadratic * fabs(rate));
    return damping + inertia * max(0.0, fabs(rate) - FASTEST_RADPS);
}

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
    double brake = vehicle->m * max(0.0, speed - FASTEST_MPS);
    return (Force){
        f_x - (max(0.0, vehicle->D_u + vehicle->D_uu * fabs(u)) + brake) * u,
        f_y - (max(0.0, vehicle->D_v + vehicle->D_vv * fabs(v)) + brake) * v,
        f_z - (max(0.0, vehicle->D_w + vehicle->D_ww * fabs(w)) + brake) * w,
        t_x - body_damping(vehicle->D_p, vehicle->D_pp, p, vehicle->i_xx + vehicle->a_44) * p,
        t_y - body_damping(vehicle->D_q, vehicle->D_qq, q, vehicle->i_yy + vehicle->a_55) * q,
        t_z - body_damping(vehicle->D_r, vehicle->D_rr, r, vehicle->i_zz + vehicle->a_66) * r,
    };
}

static inline double steepness(double linear, double quadratic, double rate, double inertia)
{
    double steepness = max(0.0, linear + 2.0 * quadratic * fabs(rate));
    if (fabs(rate) > FASTEST_RADPS)
        steepness += inertia * (2.0 * fabs(rate) - FASTEST_RADPS);
    return steepness;
}

static inline Rates rate_damping(
    double u, double v, double w, double p, double q, double r, const VehicleParams *vehicle)
{
    double xz2 = u * u + w * w;
    double speed2 = xz2 + v * v;
    double s_d2 = 0.0;
    if (xz2 > 1e-18) {
        double c_a2 = u * u / xz2;
        s_d2 = (1.0 - c_a2) * c_a2 * c_a2 * c_a2 * c_a2;
    }
    double d_x = (vehicle->K_p * (1.0 - s_d2) + vehicle->K_r * s_d2) * speed2;
    double d_z = (vehicle->K_p * s_d2 + vehicle->K_r * (1.0 - s_d2)) * speed2;
    return (Rates){
        steepness(vehicle->D_p, vehicle->D_pp, p, vehicle->i_xx + vehicle->a_44) - d_x,
        steepness(vehicle->D_q, vehicle->D_qq, q, vehicle->i_yy + vehicle->a_55)
            - vehicle->K_q * speed2,
        steepness(vehicle->D_r, vehicle->D_rr, r, vehicle->i_zz + vehicle->a_66) - d_z,
    };
}

/* ----------------------------------------------------------------------------- exponential */

typedef struct { double decay, phi_1, phi_2, phi_3; } Phi;

static inline Phi phi_functions(double z)
{
    if (z > -SERIES_BELOW) {
        double phi_3 = 0.0;
        for (int k = SERIES_TERMS + 3; k > 3; k--)
            phi_3 = (1.0 + phi_3) * z / k;
        phi_3 = (1.0 + phi_3) / 6.0;
        double phi_2 = 0.5 + z * phi_3;
        double phi_1 = 1.0 + z * phi_2;
        return (Phi){1.0 + z * phi_1, phi_1, phi_2, phi_3};
    }
    double decay = exp(z);
    double phi_1 = (decay - 1.0) / z;
    double phi_2 = (phi_1 - 1.0) / z;
    return (Phi){decay, phi_1, phi_2, (phi_2 - 0.5) / z};
}

static inline Decay decay_weights(double pole, double h)
{
    Phi half = phi_functions(-0.5 * h * pole);
    double phi_1 = 0.5 * (half.decay + 1.0) * half.phi_1;
    double phi_2 = 0.25 * ((half.decay + 1.0) * half.phi_2 + half.phi_1);
    double phi_3 = 0.125 * ((half.decay + 1.0) * half.phi_3 + half.phi_2 + 0.5 * half.phi_1);
    return (Decay){
        half.decay,
        0.5 * h * half.phi_1,
        half.decay * half.decay,
        h * (phi_1 - 3.0 * phi_2 + 4.0 * phi_3),
        h * (2.0 * phi_2 - 4.0 * phi_3),
        h * (4.0 * phi_3 - phi_2),
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
    const VehicleParams *vehicle, const DensityParams *density)
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
        = (m_b + vehicle->ballast - buoyancy_gain(motion->p_d, vehicle->m, density)) * GRAVITY;
    if (motion->p_d < vehicle->hull_radius)
        weight += (vehicle->m * GRAVITY * emerged_fraction(motion->p_d, vehicle->hull_radius))
            - surface_damping(motion, vehicle);
    Triple a = {0.0, 0.0, 0.0};
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
    const Water *water_rate, const VehicleParams *vehicle, const DensityParams *density)
{
    double q_w = motion->q_w, q_x = motion->q_x, q_y = motion->q_y, q_z = motion->q_z;
    double p = motion->p, q = motion->q, r = motion->r;
    Triple d = rotate_to_ned(q_w, q_x, q_y, q_z, motion->u, motion->v, motion->w);
    Force a = acceleration(motion, m_b, inertia, water_rate, vehicle, density);
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

static inline Motion along(const Motion *x, double h, const Motion *k, Rates rates)
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
        rates.p,
        rates.q,
        rates.r,
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

static inline Rates poles_of(const Motion *x, const Inertia *inertia, const VehicleParams *vehicle)
{
    Rates d = rate_damping(x->u, x->v, x->w, x->p, x->q, x->r, vehicle);
    return (Rates){
        max(0.0, inertia->n_xx * d.p),
        max(0.0, inertia->n_yy * d.q),
        max(0.0, inertia->n_zz * d.r),
    };
}

static inline Rates inputs(const Motion *k, const Motion *x, Rates poles)
{
    return (Rates){k->p + poles.p * x->p, k->q + poles.q * x->q, k->r + poles.r * x->r};
}

static inline Rates halfway(const Motion *x, Rates n, Decay p, Decay q, Decay r)
{
    return (Rates){
        p.half * x->p + p.half_input * n.p,
        q.half * x->q + q.half_input * n.q,
        r.half * x->r + r.half_input * n.r,
    };
}

static inline Rates whole(
    const Motion *x, Rates n_1, Rates n_4, Rates n_23, Decay p, Decay q, Decay r)
{
    return (Rates){
        p.whole * x->p + p.first * n_1.p + p.middle * n_23.p + p.last * n_4.p,
        q.whole * x->q + q.first * n_1.q + q.middle * n_23.q + q.last * n_4.q,
        r.whole * x->r + r.first * n_1.r + r.middle * n_23.r + r.last * n_4.r,
    };
}

static inline double energy(
    double u, double v, double w, double p, double q, double r,
    const Inertia *inertia, const VehicleParams *vehicle)
{
    return 0.5
        * ((vehicle->m + vehicle->a_11) * u * u + (vehicle->m + vehicle->a_22) * v * v
            + (vehicle->m + vehicle->a_33) * w * w + p * p / inertia->n_xx
            + q * q / inertia->n_yy + r * r / inertia->n_zz);
}

/* Returns the motion; the error of the worst step goes to largest. */
static inline Motion integrate(
    Motion motion, Joints start, Joints end, const Water *current, const Water *water_rate,
    const PlantParams *params, double dt, int steps, double *largest)
{
    const VehicleParams *vehicle = &params->vehicle;
    const DensityParams *density = &params->density;
    double h = dt / steps;
    bool fixed = start.x_p == end.x_p && start.mu == end.mu;
    Joints now = start;
    Inertia inertia_now = make_inertia(now.x_p, now.mu, vehicle);
    Rates poles = poles_of(&motion, &inertia_now, vehicle);
    Decay p = decay_weights(poles.p, h);
    Decay q = decay_weights(poles.q, h);
    Decay r = decay_weights(poles.r, h);
    Motion x = motion;
    *largest = 0.0;
    for (int i = 0; i < steps; i++) {
        Joints middle = between(start, end, (i + 0.5) / steps);
        Joints after = between(start, end, (i + 1.0) / steps);
        Inertia inertia_middle = inertia_now, inertia_after = inertia_now;
        if (!fixed) {
            inertia_middle = make_inertia(middle.x_p, middle.mu, vehicle);
            inertia_after = make_inertia(after.x_p, after.mu, vehicle);
        }
        Motion k_1 = derivative(&x, now.m_b, &inertia_now, current, water_rate, vehicle, density);
        Rates n_1 = inputs(&k_1, &x, poles);
        Motion x_2 = along(&x, 0.5 * h, &k_1, halfway(&x, n_1, p, q, r));
        Motion k_2
            = derivative(&x_2, middle.m_b, &inertia_middle, current, water_rate, vehicle, density);
        Rates n_2 = inputs(&k_2, &x_2, poles);
        Motion x_3 = along(&x, 0.5 * h, &k_2, halfway(&x, n_2, p, q, r));
        Motion k_3
            = derivative(&x_3, middle.m_b, &inertia_middle, current, water_rate, vehicle, density);
        Rates n_3 = inputs(&k_3, &x_3, poles);
        Rates n_31 = {2.0 * n_3.p - n_1.p, 2.0 * n_3.q - n_1.q, 2.0 * n_3.r - n_1.r};
        Motion x_4 = along(&x, h, &k_3, halfway(&x_2, n_31, p, q, r));
        Motion k_4
            = derivative(&x_4, after.m_b, &inertia_after, current, water_rate, vehicle, density);
        Rates n_4 = inputs(&k_4, &x_4, poles);
        Rates n_23 = {n_2.p + n_3.p, n_2.q + n_3.q, n_2.r + n_3.r};
        double error = energy(
            h / 6.0 * (k_1.u - k_2.u - k_3.u + k_4.u),
            h / 6.0 * (k_1.v - k_2.v - k_3.v + k_4.v),
            h / 6.0 * (k_1.w - k_2.w - k_3.w + k_4.w),
            p.last * (n_1.p - n_23.p + n_4.p),
            q.last * (n_1.q - n_23.q + n_4.q),
            r.last * (n_1.r - n_23.r + n_4.r),
            &inertia_now, vehicle);
        *largest = max(*largest, error);
        Rates rates = whole(&x, n_1, n_4, n_23, p, q, r);
        x = along(&x, h / 6.0, &k_1, rates);
        x = along(&x, h / 3.0, &k_2, rates);
        x = along(&x, h / 3.0, &k_3, rates);
        x = along(&x, h / 6.0, &k_4, rates);
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

static Dives dives_after(Dives dives, double depth, double dive)
{
    if (dives.turn == INFINITY) /* it may begin in a dive */
        return (Dives){dives.count, depth > dive, depth};
    double turn = dives.is_down ? max(dives.turn, depth) : min(dives.turn, depth);
    if (fabs(depth - turn) <= dive)
        return (Dives){dives.count, dives.is_down, turn};
    return (Dives){dives.count + dives.is_down, !dives.is_down, depth};
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
    Motion motion = state->motion;
    double error = INFINITY;
    for (int steps = 1; error > LARGEST_ERROR_J && steps <= MOST_STEPS; steps *= 2)
        motion = integrate(
            state->motion, state->joints, joints, &water, &water_rate, params, dt, steps, &error);
    Dives dives = dives_after(state->dives, motion.p_d, params->dive);
    int64_t surface_ticks = motion.p_d < SURFACE_M ? state->surface_ticks + 1 : 0;
    *state = (PlantState){motion, joints, water, state->tick + 1, dives, surface_ticks};
}

/* Steps of the plant; rows of log get the 13 numbers of the motion. */
void plant_steps(
    PlantState *state, const PlantParams *params, const Joints *commands, const Water *waters,
    int64_t n, double dt, Motion *log)
{
    for (int64_t row = 0; row < n; row++) {
        plant_step(state, commands[row], waters[row], params, dt);
        log[row] = state->motion;
    }
}
