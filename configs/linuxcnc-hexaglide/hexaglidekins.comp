component hexaglidekins "Kinematics of a Hexaglide: six sliders on parallel rails, six fixed legs";
description """
The rails run along base x. With joint i at q, the leg from the slider's joint (s.i.x + q, s.i.y, s.i.z) to
the platform's joint b.i, given in the platform's frame, is l.i long. Millimetres; the platform is turned by
a, b, c degrees about the fixed axes x, y, z in this order, as with genhexkins.

A leg that the platform's weight pulls is longer by half its play, one that it pushes is shorter by as much,
and each is longer by its compliance times its force. With play and compliance 0 nothing is.

Set the pins while the machine is off, and look at fwd-kins-fail before it is switched on again.
""";
pin in float s.#.x[6] "joint on slider # with the slider at 0, base frame";
pin in float s.#.y[6];
pin in float s.#.z[6];
pin in float b.#.x[6] "joint on the platform, platform frame";
pin in float b.#.y[6];
pin in float b.#.z[6];
pin in float l.#[6] "length of the leg";
pin in float branch.#[6] "side of its platform joint on which slider # stands: -1 towards -x, 1 towards +x";
pin in float play.#[6] "difference of the leg's length between pull and push";
pin in float compliance.#[6] "by how much the leg is longer with a force of 1 N, mm";
pin in float weight "of the platform with what it carries, N";
pin in float weight-direction.x "where it pulls, base frame";
pin in float weight-direction.y;
pin in float weight-direction.z = -1.0;
pin in float weight-centre.x "where it acts, platform frame, unless in the middle of the joints there";
pin in float weight-centre.y;
pin in float weight-centre.z;
pin in float weight-in-middle = 1.0 "1: it acts in the middle of the joints on the platform, 0: in its centre";
pin in float convergence-criterion = 1e-9 "largest error of a leg, mm, at which the forward kinematics ends";
pin in unsigned limit-iterations = 30 "of the forward kinematics";
pin out bit fwd-kins-fail "the last forward kinematics found no pose; the pose that is shown is none";
pin out bit inv-kins-fail "the last inverse kinematics was asked for a pose out of reach";
pin out unsigned last-iterations;
option singleton yes;
option extra_setup yes;
license "GPL"; // SPDX-License-Identifier: GPL-2.0-or-later, unlike the program that it comes with
author "hexacell";
;;

#include "rtapi_math.h"
#include "kinematics.h"

#define LEGS 6
#define SIZE 6
#define DEGREE (M_PI / 180.0)
#define LARGEST_STEP 20.0 /* mm; and rad, in parts of 100 mm */
#define SMALLEST_PIVOT 1e-12
#define SMALL_STEP 1e-6 /* of differences, mm and rad */
#define SEATED 0.005 /* of the weight; a leg with less force is between both lengths, so that no joint jumps */

static struct __comp_state *the_only_one;

EXTRA_SETUP() {
    the_only_one = __comp_inst;
    return 0;
}

typedef struct {
    double origin[3];
    double turn[3][3];
} Platform;

static void turn_of(const EmcPose *pose, double turn[3][3])
{
    double sa = sin(pose->a * DEGREE), ca = cos(pose->a * DEGREE);
    double sb = sin(pose->b * DEGREE), cb = cos(pose->b * DEGREE);
    double sc = sin(pose->c * DEGREE), cc = cos(pose->c * DEGREE);

    turn[0][0] = cc * cb;
    turn[0][1] = cc * sb * sa - sc * ca;
    turn[0][2] = cc * sb * ca + sc * sa;
    turn[1][0] = sc * cb;
    turn[1][1] = sc * sb * sa + cc * ca;
    turn[1][2] = sc * sb * ca - cc * sa;
    turn[2][0] = -sb;
    turn[2][1] = cb * sa;
    turn[2][2] = cb * ca;
}

static void angles_of(double turn[3][3], EmcPose *pose)
{
    pose->a = atan2(turn[2][1], turn[2][2]) / DEGREE;
    pose->b = atan2(-turn[2][0], sqrt(turn[0][0] * turn[0][0] + turn[1][0] * turn[1][0])) / DEGREE;
    pose->c = atan2(turn[1][0], turn[0][0]) / DEGREE;
}

/* From the platform's joint to the slider's with the slider at 0; arm: the platform's joint from its origin. */
static void leg_at(struct __comp_state *__comp_inst, int i, const Platform *at, double arm[3], double leg[3])
{
    double joint[3] = {b_x(i), b_y(i), b_z(i)}, slider[3] = {s_x(i), s_y(i), s_z(i)};
    int row;

    for (row = 0; row < 3; row++) {
        arm[row] = at->turn[row][0] * joint[0] + at->turn[row][1] * joint[1] + at->turn[row][2] * joint[2];
        leg[row] = slider[row] - at->origin[row] - arm[row];
    }
}

/* Errors of the legs, mm, and their derivatives by a shift and a turn of the platform; returns the largest. */
static double linearize(struct __comp_state *__comp_inst, const double *joint, const double longer[LEGS],
                        const Platform *at, double error[SIZE], double by_pose[SIZE][SIZE])
{
    double largest = 0.0;
    int i;

    for (i = 0; i < LEGS; i++) {
        double arm[3], leg[3], length = l(i) + longer[i];
        leg_at(__comp_inst, i, at, arm, leg);
        leg[0] += joint[i];
        error[i] = (leg[0] * leg[0] + leg[1] * leg[1] + leg[2] * leg[2] - length * length) / (2.0 * length);
        by_pose[i][0] = -leg[0] / length;
        by_pose[i][1] = -leg[1] / length;
        by_pose[i][2] = -leg[2] / length;
        by_pose[i][3] = -(arm[1] * leg[2] - arm[2] * leg[1]) / length;
        by_pose[i][4] = -(arm[2] * leg[0] - arm[0] * leg[2]) / length;
        by_pose[i][5] = -(arm[0] * leg[1] - arm[1] * leg[0]) / length;
        if (!(fabs(error[i]) <= largest))
            largest = fabs(error[i]);
    }
    return largest;
}

static void exchange(double a[SIZE][SIZE], double b[SIZE], int one, int other)
{
    double kept;
    int column;

    for (column = 0; column < SIZE; column++) {
        kept = a[one][column];
        a[one][column] = a[other][column];
        a[other][column] = kept;
    }
    kept = b[one];
    b[one] = b[other];
    b[other] = kept;
}

/* Gaussian elimination with row pivoting; the solution is left in b; 0 if the matrix is regular. */
static int solve(double a[SIZE][SIZE], double b[SIZE])
{
    int column, row, rest;

    for (column = 0; column < SIZE; column++) {
        int pivot = column;
        for (row = column + 1; row < SIZE; row++)
            if (fabs(a[row][column]) > fabs(a[pivot][column]))
                pivot = row;
        if (!(fabs(a[pivot][column]) > SMALLEST_PIVOT))
            return -1;
        exchange(a, b, pivot, column);
        for (row = column + 1; row < SIZE; row++) {
            double factor = a[row][column] / a[column][column];
            for (rest = column; rest < SIZE; rest++)
                a[row][rest] -= factor * a[column][rest];
            b[row] -= factor * b[column];
        }
    }
    for (row = SIZE - 1; row >= 0; row--) {
        for (rest = row + 1; rest < SIZE; rest++)
            b[row] -= a[row][rest] * b[rest];
        b[row] /= a[row][row];
    }
    return 0;
}

/* The platform shifted, and turned about the base axes by a rotation vector; no step is longer than a limit. */
static void move(Platform *at, const double step[SIZE])
{
    double shift = sqrt(step[0] * step[0] + step[1] * step[1] + step[2] * step[2]);
    double angle = sqrt(step[3] * step[3] + step[4] * step[4] + step[5] * step[5]);
    double longest = shift > 100.0 * angle ? shift : 100.0 * angle;
    double scale = longest > LARGEST_STEP ? LARGEST_STEP / longest : 1.0;
    double turned[3][3], axis[3] = {0.0, 0.0, 1.0}, s, c;
    int row, column;

    for (row = 0; row < 3; row++) {
        at->origin[row] += scale * step[row];
        if (angle > 0.0)
            axis[row] = step[3 + row] / angle;
    }
    s = sin(scale * angle);
    c = cos(scale * angle);
    for (column = 0; column < 3; column++) {
        double v[3] = {at->turn[0][column], at->turn[1][column], at->turn[2][column]};
        double along = axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2];
        for (row = 0; row < 3; row++) {
            int next = (row + 1) % 3, last = (row + 2) % 3;
            turned[row][column] =
                c * v[row] + s * (axis[next] * v[last] - axis[last] * v[next]) + (1.0 - c) * along * axis[row];
        }
    }
    for (row = 0; row < 3; row++)
        for (column = 0; column < 3; column++)
            at->turn[row][column] = turned[row][column];
}

/* The joints for legs that are longer by some lengths; 0 if the pose is within reach. */
static int place(struct __comp_state *__comp_inst, const Platform *at, const double longer[LEGS],
                 double joint[LEGS])
{
    double arm[3], leg[3];
    int i;

    for (i = 0; i < LEGS; i++) {
        double length = l(i) + longer[i], left;
        leg_at(__comp_inst, i, at, arm, leg);
        left = length * length - leg[1] * leg[1] - leg[2] * leg[2];
        if (!(left >= 0.0))
            return -1;
        joint[i] = (branch(i) < 0.0 ? -1.0 : 1.0) * sqrt(left) - leg[0];
    }
    return 0;
}

static int is_corrected(struct __comp_state *__comp_inst)
{
    int i, found = 0;

    for (i = 0; i < LEGS; i++)
        found |= play(i) != 0.0 || compliance(i) != 0.0;
    return found;
}

/* Where the weight pulls, a unit vector, and its moment about the platform's origin by a weight of 1 N. */
static int load_at(struct __comp_state *__comp_inst, const Platform *at, double load[SIZE])
{
    double pull[3] = {weight_direction_x, weight_direction_y, weight_direction_z};
    double centre[3] = {weight_centre_x, weight_centre_y, weight_centre_z}, acts[3];
    double size = sqrt(pull[0] * pull[0] + pull[1] * pull[1] + pull[2] * pull[2]);
    int i, row;

    if (!(size > 0.0))
        return -1;
    if (weight_in_middle != 0.0) {
        centre[0] = centre[1] = centre[2] = 0.0;
        for (i = 0; i < LEGS; i++) {
            centre[0] += b_x(i) / LEGS;
            centre[1] += b_y(i) / LEGS;
            centre[2] += b_z(i) / LEGS;
        }
    }
    for (row = 0; row < 3; row++) {
        load[row] = pull[row] / size;
        acts[row] = at->turn[row][0] * centre[0] + at->turn[row][1] * centre[1] + at->turn[row][2] * centre[2];
    }
    load[3] = acts[1] * load[2] - acts[2] * load[1];
    load[4] = acts[2] * load[0] - acts[0] * load[2];
    load[5] = acts[0] * load[1] - acts[1] * load[0];
    return 0;
}

/* By how much longer the legs are at a pose under the weight; where no forces hold it, longer is as before.
 * Virtual work: with the joints held, the forces of the legs do on their lengths what the weight does. */
static int stretch(struct __comp_state *__comp_inst, const Platform *at, double longer[LEGS])
{
    const double rigid[LEGS] = {0.0};
    double joint[LEGS], force[SIZE], error[SIZE], by_pose[SIZE][SIZE], by_leg[SIZE][SIZE];
    int i, row;

    if (place(__comp_inst, at, rigid, joint) || load_at(__comp_inst, at, force))
        return -1;
    linearize(__comp_inst, joint, rigid, at, error, by_pose);
    for (row = 0; row < SIZE; row++)
        for (i = 0; i < LEGS; i++)
            by_leg[row][i] = by_pose[i][row];
    if (solve(by_leg, force))
        return -1;
    for (i = 0; i < LEGS; i++) {
        double side = force[i] / SEATED;
        side = side > 1.0 ? 1.0 : side < -1.0 ? -1.0 : side;
        longer[i] = 0.5 * play(i) * side + compliance(i) * weight * force[i];
    }
    return 0;
}

/* The derivatives of the errors with those of the lengths under the weight. */
static void add_stretching(struct __comp_state *__comp_inst, const Platform *at, const double longer[LEGS],
                           double by_pose[SIZE][SIZE])
{
    int column, i;

    for (column = 0; column < SIZE; column++) {
        double step[SIZE] = {0.0}, there[LEGS];
        Platform near = *at;
        step[column] = SMALL_STEP;
        move(&near, step);
        if (stretch(__comp_inst, &near, there))
            continue;
        for (i = 0; i < LEGS; i++)
            by_pose[i][column] -= (there[i] - longer[i]) / SMALL_STEP;
    }
}

KINS_NOT_SWITCHABLE
EXPORT_SYMBOL(kinematicsType);
EXPORT_SYMBOL(kinematicsForward);
EXPORT_SYMBOL(kinematicsInverse);

KINEMATICS_TYPE kinematicsType()
{
    return KINEMATICS_BOTH;
}

/* Newton's method from the pose in world. On failure world is as before.
 * Joints that no pose has while a leg goes from push to pull get, in the second half of the iterations, that
 * of legs as long as they are at the start. */
int kinematicsForward(const double *joint, EmcPose *world, const KINEMATICS_FORWARD_FLAGS *fflags,
                      KINEMATICS_INVERSE_FLAGS *iflags)
{
    struct __comp_state *__comp_inst = the_only_one;
    double error[SIZE], by_pose[SIZE][SIZE], longer[LEGS] = {0.0};
    Platform at = {{world->tran.x, world->tran.y, world->tran.z}}, start;
    unsigned int done, half = limit_iterations / 2;
    int row, corrected = is_corrected(__comp_inst);

    turn_of(world, at.turn);
    start = at;
    for (done = 0; done <= limit_iterations; done++) {
        if (corrected && done == half)
            at = start;
        if (corrected && done <= half)
            stretch(__comp_inst, &at, longer);
        if (linearize(__comp_inst, joint, longer, &at, error, by_pose) <= convergence_criterion) {
            world->tran.x = at.origin[0];
            world->tran.y = at.origin[1];
            world->tran.z = at.origin[2];
            angles_of(at.turn, world);
            last_iterations = done;
            fwd_kins_fail = 0;
            return 0;
        }
        for (row = 0; row < SIZE; row++)
            error[row] = -error[row];
        if (corrected && done < half)
            add_stretching(__comp_inst, &at, longer, by_pose);
        if (solve(by_pose, error)) {
            if (!corrected || done >= half)
                break;
            done = half - 1;
            continue;
        }
        move(&at, error);
    }
    last_iterations = done;
    fwd_kins_fail = 1;
    return -1;
}

int kinematicsInverse(const EmcPose *world, double *joint, const KINEMATICS_INVERSE_FLAGS *iflags,
                      KINEMATICS_FORWARD_FLAGS *fflags)
{
    struct __comp_state *__comp_inst = the_only_one;
    Platform at = {{world->tran.x, world->tran.y, world->tran.z}};
    double longer[LEGS] = {0.0}, found[LEGS];
    int i;

    turn_of(world, at.turn);
    if ((is_corrected(__comp_inst) && stretch(__comp_inst, &at, longer)) ||
        place(__comp_inst, &at, longer, found)) {
        inv_kins_fail = 1;
        return -1;
    }
    for (i = 0; i < LEGS; i++)
        joint[i] = found[i];
    inv_kins_fail = 0;
    return 0;
}
