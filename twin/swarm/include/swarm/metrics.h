// SPDX-License-Identifier: Apache-2.0
// What a swarm does, in numbers, and the class they put it in.
#ifndef SWARM_METRICS_H
#define SWARM_METRICS_H

#include <array>
#include <deque>
#include <span>
#include <vector>

#include "plant/plant.h"

namespace twin
{

// z_i: position, r_i = |z_i - mean z|, u_i: velocity in W, R: view range. The ring's metrics leave
// odd robots out. A metric that is not defined (one robot has no ring) is NaN.
struct Metrics
{
    // (max r - min r) / min r, 0 for a perfect ring (Vega et al. 2024, arXiv 2410.16444). A robot
    // in the middle makes it very large.
    double circliness = 0;
    double radius_m = 0;    // mean r
    double scatter_m2 = 0;  // mean r^2
    // Mean of (r_i x u_i) / (|r_i| |u_i|): 1 = all circle counter-clockwise, -1 = clockwise.
    double rotation = 0;
    double odd_ratio = 0;  // mean distance of odd robots from the ring's centre over radius_m
    // Over all robots, odd ones included:
    // Least distance of two turning centres o_i over R, o = z + (v / omega) (-sin, cos) of the
    // direction of travel, o = z where omega = 0. Above 1: nobody can reach another's view.
    double diffusion = 0;
    double groups = 0;    // components of the graph "closer than R"
    double contacts = 0;  // pairs of bodies that touch (2 % of the diameter apart at most)
};

constexpr double kTouch = 1.02;  // bodies touch up to this many diameters apart

struct MetricScale
{
    double range_m;
    double body_radius_m;  // 0: nothing touches
};

// How a robot with this velocity in its own frame moves, see MotionColumn.
using Motion = std::array<double, 4>;
Motion MotionOf(double vx_mps, double vy_mps, double omega_radps);

// Which robots make the ring: the first `size` of `order`, which has all robots.
struct Ring
{
    std::vector<size_t> order;
    size_t size;
};

// The first `ring_size` robots make the ring; those after them are odd.
Metrics Measure(std::span<const RobotState> robots, size_t ring_size, const MetricScale &scale);

// The mean of each metric over the newest `window_s`.
class MetricWindow
{
public:
    explicit MetricWindow(double window_s) : window_s_(window_s) {}
    void Add(double t_s, const Metrics &metrics);
    Metrics Mean() const;

private:
    double window_s_;
    std::deque<std::pair<double, Metrics>> kept_;
};

// "milling": circliness below 0.2, turning together (|rotation| above 0.9) and bodies apart (less
// than one pair in touch half of the time). "jammed": below 0.2 but not so. "ellipsoidal": up to 1.
// Above: "cluster" if all are within view range in one group, else "separated". "undefined": NaN.
const char *Classify(const Metrics &mean);

}  // namespace twin

#endif
