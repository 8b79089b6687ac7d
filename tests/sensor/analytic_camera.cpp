// SPDX-License-Identifier: Apache-2.0
#include "analytic_camera.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace twin
{
namespace
{

struct Point
{
    double ahead, left, up;
};

struct Interval
{
    double begin, end;
    double Length() const { return end - begin; }
};
using Row = std::vector<Interval>;  // ascending, apart

Point ToCamera(const Eigen::Vector3d &p, const Pose2 &robot, const CameraSettings &s)
{
    const double c = std::cos(robot.theta_rad), d = std::sin(robot.theta_rad);
    const double x = p.x() - robot.x_m, y = p.y() - robot.y_m;
    return {c * x + d * y - s.forward_m, c * y - d * x, p.z() - s.height_m};
}

double Dot(const Point &p, const Point &q)
{
    return p.ahead * q.ahead + p.left * q.left + p.up * q.up;
}

// Of a l^2 + b l + c, ascending; none if there are not two.
std::vector<double> Roots(double a, double b, double c)
{
    const double root = b * b - 4 * a * c;
    if (a == 0 || root <= 0)
        return {};
    const double l1 = (-b + std::sqrt(root)) / (2 * a), l2 = (-b - std::sqrt(root)) / (2 * a);
    return {std::min(l1, l2), std::max(l1, l2)};
}

// The silhouette of a ball on the line at height `up` of the plane one metre ahead: the roots of
//   ((1, l, up) c)^2 = (1 + l^2 + up^2) (c^2 - r^2)
Row BallRow(const Point &c, double radius_m, double up)
{
    const double k = Dot(c, c) - radius_m * radius_m, m = c.ahead + up * c.up;
    const std::vector<double> l =
        Roots(c.left * c.left - k, 2 * m * c.left, m * m - (1 + up * up) * k);
    return l.empty() || c.ahead <= radius_m ? Row{} : Row{{l[0], l[1]}};
}

// The part of a box that is ahead is spanned by its corners there and by where chords cross.
std::vector<Point> VisibleCorners(const Box &box, const Pose2 &robot, const CameraSettings &s)
{
    constexpr double kNear_m = 1e-3;
    std::vector<Point> corners, visible;
    const double c = std::cos(box.yaw_rad), d = std::sin(box.yaw_rad);
    for (const double i : {-1, 1})
        for (const double j : {-1, 1})
            for (const double k : {-1, 1})
            {
                const double x = i * box.half_m.x(), y = j * box.half_m.y();
                const Eigen::Vector3d at_m(c * x - d * y, d * x + c * y, k * box.half_m.z());
                corners.push_back(ToCamera(box.centre_m + at_m, robot, s));
            }
    for (const Point &p : corners)
        if (p.ahead >= kNear_m)
            visible.push_back(p);
        else
            for (const Point &q : corners)
                if (q.ahead > kNear_m)
                {
                    const double t = (kNear_m - p.ahead) / (q.ahead - p.ahead);
                    visible.push_back(
                        {kNear_m, p.left + t * (q.left - p.left), p.up + t * (q.up - p.up)});
                }
    for (Point &p : visible)
        p = {1, p.left / p.ahead, p.up / p.ahead};
    return visible;
}

// A convex silhouette on a line: the extremes of all chords between its corners that cross it.
Row PolygonRow(const std::vector<Point> &corners, double up)
{
    Interval row{std::numeric_limits<double>::infinity(), 0};
    row.end = -row.begin;
    for (const Point &p : corners)
        for (const Point &q : corners)
            if (p.up <= up && up < q.up)
            {
                const double left = p.left + (up - p.up) / (q.up - p.up) * (q.left - p.left);
                row = {std::min(row.begin, left), std::max(row.end, left)};
            }
    return row.begin < row.end ? Row{row} : Row{};
}

Row Subtract(const Row &row, const Interval &hidden)
{
    Row rest;
    for (const Interval &part : row)
    {
        if (part.begin < std::min(part.end, hidden.begin))
            rest.push_back({part.begin, std::min(part.end, hidden.begin)});
        if (std::max(part.begin, hidden.end) < part.end)
            rest.push_back({std::max(part.begin, hidden.end), part.end});
    }
    return rest;
}

void Add(Row &row, Row more)
{
    row.insert(row.end(), more.begin(), more.end());
    std::sort(row.begin(), row.end(),
              [](const Interval &a, const Interval &b) { return a.begin < b.begin; });
    Row joined;
    for (const Interval &part : row)
        if (!joined.empty() && part.begin <= joined.back().end)
            joined.back().end = std::max(joined.back().end, part.end);
        else
            joined.push_back(part);
    row = joined;
}

// Where the row crosses the circles in which a ball cuts the planes of a box's faces. On the plane
// n p = d is p = (1, l, up) d / v with v = n (1, l, up), on the ball (p - c)^2 = r^2, so
//   d^2 (1 + l^2 + up^2) - 2 d v (1, l, up) c + v^2 (c^2 - r^2) = 0
std::vector<double> Seams(const Box &box, const Ball &ball, double up, const Pose2 &robot,
                          const CameraSettings &s)
{
    const Point c = ToCamera(ball.centre_m, robot, s), at = ToCamera(box.centre_m, robot, s);
    const double k = Dot(c, c) - ball.radius_m * ball.radius_m, m = c.ahead + up * c.up;
    const double turn_rad = box.yaw_rad - robot.theta_rad;
    const double x = std::cos(turn_rad), y = std::sin(turn_rad);
    const Point normals[] = {{x, y, 0}, {-y, x, 0}, {0, 0, 1}};
    std::vector<double> seams;
    for (int i = 0; i < 3; ++i)
        for (const double side : {-1, 1})
        {
            const Point &n = normals[i];
            const double d = Dot(n, at) + side * box.half_m[i], v = n.ahead + up * n.up;
            for (const double left : Roots(d * d - 2 * d * n.left * c.left + k * n.left * n.left,
                                           2 * k * v * n.left - 2 * d * (v * c.left + m * n.left),
                                           d * d * (1 + up * up) - 2 * d * v * m + k * v * v))
                seams.push_back(left);
        }
    return seams;
}

// Of a ray that meets both: the ball comes later if the box holds the point where the ray enters
// the ball, or if the eye is on the box's side of the plane that parts that point from the box.
bool Hides(const Box &box, const Ball &ball, double left, double up, const Pose2 &robot,
           const CameraSettings &s)
{
    const double cr = std::cos(robot.theta_rad), dr = std::sin(robot.theta_rad);
    const Eigen::Vector3d eye_m(robot.x_m + s.forward_m * cr, robot.y_m + s.forward_m * dr,
                                s.height_m);
    const Eigen::Vector3d ray = Eigen::Vector3d(cr - dr * left, dr + cr * left, up).normalized();
    const Eigen::Vector3d to_ball = ball.centre_m - eye_m;
    const double along_m = ray.dot(to_ball);
    const double within_m = std::sqrt(
        std::max(0.0, ball.radius_m * ball.radius_m - (to_ball - along_m * ray).squaredNorm()));
    const double c = std::cos(box.yaw_rad), d = std::sin(box.yaw_rad);
    const auto to_box = [&](const Eigen::Vector3d &p) {
        const Eigen::Vector3d v = p - box.centre_m;
        return Eigen::Vector3d(c * v.x() + d * v.y(), c * v.y() - d * v.x(), v.z());
    };
    const Eigen::Vector3d entry = to_box(eye_m + (along_m - within_m) * ray);
    const Eigen::Vector3d nearest = entry.cwiseMax(-box.half_m).cwiseMin(box.half_m);
    return entry == nearest || (to_box(eye_m) - nearest).dot(entry - nearest) < 0;
}

// The parts of a ball's row that a box hides. Which of both comes first changes at seams alone: a
// mast may end inside its ball.
Row HiddenRow(const Row &ball_row, const Row &box_row, const Box &box, const Ball &ball, double up,
              const Pose2 &robot, const CameraSettings &s)
{
    Row hidden;
    if (ball_row.empty() || box_row.empty())
        return hidden;
    const double begin = std::max(ball_row.front().begin, box_row.front().begin);
    const double end = std::min(ball_row.back().end, box_row.back().end);
    if (begin >= end)
        return hidden;
    std::vector<double> cuts = Seams(box, ball, up, robot, s);
    std::erase_if(cuts, [&](double left) { return left <= begin || left >= end; });
    cuts.insert(cuts.end(), {begin, end});
    std::sort(cuts.begin(), cuts.end());
    for (size_t i = 1; i < cuts.size(); ++i)
        if (Hides(box, ball, (cuts[i - 1] + cuts[i]) / 2, up, robot, s))
            hidden.push_back({cuts[i - 1], cuts[i]});
    return hidden;
}

// Sizes of the connected parts' largest. Edges move outward by `edge` and parts join over `gap`.
double Largest(const std::vector<Row> &rows, double edge, double gap)
{
    std::vector<double> area;
    std::vector<size_t> parent;
    const auto root = [&parent](size_t i) {
        while (parent[i] != i)
            i = parent[i];
        return i;
    };
    std::vector<std::pair<Interval, size_t>> above;
    for (const Row &row : rows)
    {
        std::vector<std::pair<Interval, size_t>> here;
        for (Interval part : row)
        {
            part = {part.begin - edge, part.end + edge};
            if (part.Length() <= 0)
                continue;
            const size_t id = area.size();
            area.push_back(part.Length());
            parent.push_back(id);
            std::vector<std::pair<Interval, size_t>> near = above;
            near.insert(near.end(), here.begin(), here.end());
            for (const auto &[other, other_id] : near)
                if (other.begin <= part.end + gap && part.begin <= other.end + gap &&
                    root(other_id) != root(id))
                {
                    area[root(id)] += area[root(other_id)];
                    parent[root(other_id)] = root(id);
                }
            here.emplace_back(part, id);
        }
        above = here;
    }
    return area.empty() ? 0 : *std::max_element(area.begin(), area.end());
}

double Area(const std::vector<Row> &rows)
{
    double area = 0;
    for (const Row &row : rows)
        for (const Interval &part : row)
            area += part.Length();
    return area;
}

}  // namespace

Sighting SeeGreen(const Scene &scene, const Pose2 &robot, const CameraSettings &s, double edge_px)
{
    const double f = s.lens.focal_px;
    const size_t height = static_cast<size_t>(s.height_px);
    std::vector<std::vector<Point>> hulls;
    for (const Box &box : scene.boxes)
        hulls.push_back(VisibleCorners(box, robot, s));
    std::vector<Row> whole(height), seen(height);
    for (const Ball &ball : scene.balls)
    {
        const Point centre = ToCamera(ball.centre_m, robot, s);
        for (size_t r = 0; r < height; ++r)
        {
            const double up = (s.height_px / 2.0 - static_cast<double>(r) - 0.5) / f;
            Row row = BallRow(centre, ball.radius_m, up);
            row = row.empty() ? row : Subtract(row, {s.width_px / (2 * f), 1e9});
            row = row.empty() ? row : Subtract(row, {-1e9, -s.width_px / (2 * f)});
            Add(whole[r], row);
            for (size_t b = 0; b < hulls.size() && !row.empty(); ++b)
                for (const Interval &hidden :
                     HiddenRow(row, PolygonRow(hulls[b], up), scene.boxes[b], ball, up, robot, s))
                    row = Subtract(row, hidden);
            Add(seen[r], row);
        }
    }
    for (std::vector<Row> *rows : {&whole, &seen})
        for (Row &row : *rows)
            for (Interval &part : row)
                part = {f * part.begin, f * part.end};
    return {Area(whole), Area(seen), Largest(seen, 0, 0), Largest(seen, -edge_px, 0),
            Largest(seen, edge_px, 1)};
}

}  // namespace twin
