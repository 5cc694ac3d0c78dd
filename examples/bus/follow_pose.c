/* Prints the robot's pose in the map, live, as CSV.

       randt layout --c > randt_bus.h
       cc -std=c11 follow_pose.c -lrandt_bus -lm -o follow_pose
       ./follow_pose [SCANS [PREFIX [RUN]]]

   librandt_bus.so: target/debug after cargo build --workspace, /usr/lib/randt of the package. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "randt_bus.h"

enum { FRAMES_MAX = 64 };

static int failed(void) {
    fprintf(stderr, "follow_pose: %s\n", randt_bus_error());
    return 1;
}

/* The pose b (x m, y m, yaw rad), which is given in a, in the frame that a is given in. */
static void transform(const double a[3], const double b[3], double out[3]) {
    double c = cos(a[2]), s = sin(a[2]);
    out[0] = a[0] + c * b[0] - s * b[1];
    out[1] = a[1] + s * b[0] + c * b[1];
    out[2] = remainder(a[2] + b[2], 6.283185307179586);
}

int main(int count, char **arguments) {
    long scans = count > 1 ? atol(arguments[1]) : -1;
    const char *prefix = count > 2 ? arguments[2] : NULL;
    const char *run = count > 3 ? arguments[3] : NULL;

    struct randt_bus *bus = randt_bus_open(prefix, run);
    if (!bus)
        return failed();
    struct randt_reader *states =
        randt_bus_subscribe(bus, RANDT_ODOMETRY_STATE_TOPIC, RANDT_ODOMETRY_STATE_TYPE);
    if (!states)
        return failed();
    struct randt_reader *corrections =
        randt_bus_subscribe(bus, RANDT_MAPPER_CORRECTION_TOPIC, RANDT_MAPPER_CORRECTION_TYPE);
    if (!corrections)
        return failed();

    /* The newest place of each odometry frame in the map. A frame that has none is not joined to
       the map: its poses are only true within it. */
    struct randt_correction placed[FRAMES_MAX];
    size_t frames = 0;
    const char *trusts[] = {"lost", "degraded", "good"};

    printf("stamp_ns,frame,x_m,y_m,yaw_rad,trust\n");
    while (scans != 0) {
        struct randt_message message;
        int has_come = randt_reader_receive(states, 500, &message);
        if (has_come < 0)
            return failed();
        if (has_come == 0)
            continue;
        struct randt_odometry_state state = *(const struct randt_odometry_state *)message.head;
        while (randt_reader_receive(corrections, 0, &message) == 1) {
            const struct randt_correction *correction = message.head;
            size_t i = 0;
            while (i < frames && placed[i].odom_frame_id != correction->odom_frame_id)
                i++;
            if (i < FRAMES_MAX)
                placed[i] = *correction;
            if (i == frames && frames < FRAMES_MAX)
                frames++;
        }
        const char *frame = "odom";
        double pose[3] = {state.pose[0], state.pose[1], state.pose[2]};
        for (size_t i = 0; i < frames; i++)
            if (placed[i].odom_frame_id == state.odom_frame_id) {
                frame = "map";
                transform(placed[i].map_from_odom, state.pose, pose);
            }
        const char *trust = state.trust <= RANDT_ODOMETRY_STATE_TRUST_GOOD ? trusts[state.trust] : "unknown";
        printf("%lld,%s,%.4f,%.4f,%.5f,%s\n", (long long)state.header.stamp_ns, frame, pose[0], pose[1],
               pose[2], trust);
        fflush(stdout);
        scans -= scans > 0;
    }
    randt_reader_close(states);
    randt_reader_close(corrections);
    randt_bus_close(bus);
    return 0;
}
