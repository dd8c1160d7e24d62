component hexaglidekins "Kinematics of a Hexaglide: six sliders on parallel rails, six fixed legs";
description """
The rails run along base x. With joint i at q, the leg from the slider's joint (s.i.x + q, s.i.y, s.i.z) to
the platform's joint b.i, given in the platform's frame, is l.i long. Millimetres; the platform is turned by
a, b, c degrees about the fixed axes x, y, z in this order, as with genhexkins.

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
pin in float convergence-criterion = 1e-9 "largest error of a leg, mm, at which the forward kinematics ends";
pin in unsigned limit-iterations = 30 "of the forward kinematics";
pin out bit fwd-kins-fail "the last forward kinematics found no pose; the pose that is shown is none";
pin out bit inv-kins-fail "the last inverse kinematics was asked for a pose out of reach";
pin out unsigned last-iterations;
option singleton yes;
option extra_setup yes;
license "GPL"; // a LinuxCNC module: version 2 or later, unlike the program that it comes with
author "hexacell";
;;

#include "rtapi_math.h"
#include "kinematics.h"

#define LEGS 6
#define SIZE 6
#define DEGREE (M_PI / 180.0)
#define LARGEST_STEP 20.0 /* mm; and rad, in parts of 100 mm */
#define SMALLEST_PIVOT 1e-12

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
static double linearize(struct __comp_state *__comp_inst, const double *joint, const Platform *at,
                        double error[SIZE], double by_pose[SIZE][SIZE])
{
    double largest = 0.0;
    int i;

    for (i = 0; i < LEGS; i++) {
        double arm[3], leg[3], length = l(i);
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

KINS_NOT_SWITCHABLE
EXPORT_SYMBOL(kinematicsType);
EXPORT_SYMBOL(kinematicsForward);
EXPORT_SYMBOL(kinematicsInverse);

KINEMATICS_TYPE kinematicsType()
{
    return KINEMATICS_BOTH;
}

/* Newton's method from the pose in world. On failure world is as before. */
int kinematicsForward(const double *joint, EmcPose *world, const KINEMATICS_FORWARD_FLAGS *fflags,
                      KINEMATICS_INVERSE_FLAGS *iflags)
{
    struct __comp_state *__comp_inst = the_only_one;
    double error[SIZE], by_pose[SIZE][SIZE];
    Platform at = {{world->tran.x, world->tran.y, world->tran.z}};
    unsigned int done;
    int row;

    turn_of(world, at.turn);
    for (done = 0; done <= limit_iterations; done++) {
        if (linearize(__comp_inst, joint, &at, error, by_pose) <= convergence_criterion) {
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
        if (solve(by_pose, error))
            break;
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
    double arm[3], leg[3], found[LEGS];
    int i;

    turn_of(world, at.turn);
    for (i = 0; i < LEGS; i++) {
        double left;
        leg_at(__comp_inst, i, &at, arm, leg);
        left = l(i) * l(i) - leg[1] * leg[1] - leg[2] * leg[2];
        if (!(left >= 0.0)) {
            inv_kins_fail = 1;
            return -1;
        }
        found[i] = (branch(i) < 0.0 ? -1.0 : 1.0) * sqrt(left) - leg[0];
    }
    for (i = 0; i < LEGS; i++)
        joint[i] = found[i];
    inv_kins_fail = 0;
    return 0;
}
