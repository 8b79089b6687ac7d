// SPDX-License-Identifier: Apache-2.0
// Sums and filters over time of many columns at once, row by row and not value by value.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "arrays.h"

using namespace nanobind::literals;

namespace twin
{
namespace
{

constexpr size_t kNoPlace = SIZE_MAX;

// By row of values: 0 where a list has its number, else kNoPlace.
std::vector<size_t> Wanted(size_t count, std::initializer_list<std::span<const int64_t>> lists)
{
    std::vector<size_t> place(count, kNoPlace);
    for (const auto &list : lists)
        for (const int64_t n : list)
            if (n < 0 || static_cast<size_t>(n) >= count)
                throw std::invalid_argument("starts and ends must be rows of values");
            else
                place[static_cast<size_t>(n)] = 0;
    return place;
}

// Columns (N, m k): each of the second's m signals times each of the first's k gains.
using Product = std::pair<Matrix, Matrix>;

size_t WidthOf(const Product &product)
{
    return product.first.shape(1) * product.second.shape(1);
}

// Of all columns side by side.
size_t WidthOf(const std::vector<Product> &products, size_t count)
{
    size_t width = 0;
    for (const Product &product : products)
    {
        if (product.first.shape(0) != count || product.second.shape(0) != count)
            throw std::invalid_argument("steps must be as many as rows of gains and of signals");
        width += WidthOf(product);
    }
    return width;
}

// Adds a row of several products to sums, one after the other for each share.
double *AddRow(const std::vector<Product> &products, size_t n, std::span<const double> shares,
               double *sum)
{
    for (const auto &[gains, signals] : products)
    {
        const size_t width = gains.shape(1), count = signals.shape(1);
        const double *gain = gains.data() + n * width, *signal = signals.data() + n * count;
        for (const double share : shares)
            for (size_t k = 0; k < count; ++k, sum += width)
                for (size_t f = 0; f < width; ++f)
                    sum[f] += share * (gain[f] * signal[k]);
    }
    return sum;
}

// Writes what lies between two sums, along a direction.
double *WriteBetween(const std::vector<Product> &products, const double *&from, const double *&to,
                     std::span<const double> direction, double *out)
{
    for (const Product &product : products)
    {
        const size_t width = WidthOf(product);
        for (size_t f = 0; f < width; ++f)
            out[f] = direction[0] * (to[f] - from[f]);
        for (size_t k = 1; k < direction.size(); ++k)
            for (size_t f = 0; f < width; ++f)
                out[f] += direction[k] * (to[k * width + f] - from[k * width + f]);
        from += direction.size() * width;
        to += direction.size() * width;
        out += width;
    }
    return out;
}

// How far velocities lead a robot along a direction of the plane, from each start to its end; or
// by turning rates how far it turns.
Array LedBetween(const std::vector<Product> &forward, const std::vector<Product> &left,
                 Matrix steps, Indices starts, Indices ends, Matrix direction)
{
    const size_t count = steps.shape(0), ways = steps.shape(1), rows = starts.size();
    if ((ways != 1 || !left.empty()) && ways != 2)
        throw std::invalid_argument("steps must have two columns, or for turning one");
    if (ends.size() != rows || direction.shape(0) != rows || direction.shape(1) != ways)
        throw std::invalid_argument("ends and directions must be as many as starts, and as steps");
    const size_t width = WidthOf(forward, count) + WidthOf(left, count);
    std::vector<size_t> place = Wanted(count, {Span(starts), Span(ends)});
    std::vector<double> sums, row(ways * width);
    sums.reserve(row.size() * static_cast<size_t>(std::ranges::count(place, 0U)));
    for (size_t n = 0; n < count; ++n)
    {
        const std::span<const double> ahead(steps.data() + ways * n, ways);
        double *aside = AddRow(forward, n, ahead, row.data());
        if (!left.empty())
            AddRow(left, n, std::array{-ahead[1], ahead[0]}, aside);
        if (place[n] == kNoPlace)
            continue;
        place[n] = sums.size();
        sums.insert(sums.end(), row.begin(), row.end());
    }
    auto led = std::make_unique_for_overwrite<double[]>(rows * width);
    for (size_t r = 0; r < rows; ++r)
    {
        const double *from = sums.data() + place[static_cast<size_t>(starts.data()[r])];
        const double *to = sums.data() + place[static_cast<size_t>(ends.data()[r])];
        const std::span<const double> along(direction.data() + ways * r, ways);
        WriteBetween(left, from, to, along,
                     WriteBetween(forward, from, to, along, led.get() + r * width));
    }
    return ToNumpy(std::move(led), {rows, width});
}

// A motion over N steps, and the windows (W, H) in which it is seen.
struct Seen
{
    std::span<const double> step_s, heading_rad, at_rad;  // (N), (N), (W)
    std::span<const int64_t> starts, ends;

    size_t Horizons() const { return starts.empty() ? 0 : ends.size() / starts.size(); }
};

// Sums at the places where windows start or end.
class Places
{
public:
    Places(const Seen &seen, size_t width)
        : place_(Wanted(seen.step_s.size(), {seen.starts, seen.ends}))
    {
        kept_.reserve(width * static_cast<size_t>(std::ranges::count(place_, 0U)));
    }

    void Keep(size_t n, const std::vector<double> &sums)
    {
        if (place_[n] == kNoPlace)
            return;
        place_[n] = kept_.size();
        kept_.insert(kept_.end(), sums.begin(), sums.end());
    }

    const double *At(int64_t n) const { return kept_.data() + place_[static_cast<size_t>(n)]; }

private:
    std::vector<size_t> place_;
    std::vector<double> kept_;
};

// Calls write(from, to, cos, sin, out) for each window: sums at its start and end, its first
// direction, and room for (3, T) displacements.
template <class Write>
std::unique_ptr<double[]> ForEachWindow(const Seen &seen, const Places &places, size_t width,
                                        Write write)
{
    auto displaced = std::make_unique_for_overwrite<double[]>(3 * seen.ends.size() * width);
    double *out = displaced.get();
    for (size_t w = 0; w < seen.starts.size(); ++w)
    {
        const double *from = places.At(seen.starts[w]);
        const double c = std::cos(seen.at_rad[w]), s = std::sin(seen.at_rad[w]);
        for (size_t h = 0; h < seen.Horizons(); ++h, out += 3 * width)
            write(from, places.At(seen.ends[w * seen.Horizons() + h]), c, s, out);
    }
    return displaced;
}

// By speeds (N, T) forward, or to the left.
std::unique_ptr<double[]> DisplacedByDriving(Matrix values, const Seen &seen, bool left)
{
    const size_t count = values.shape(0), width = values.shape(1);
    std::vector<double> sums(2 * width);
    Places places(seen, sums.size());
    for (size_t n = 0; n < count; ++n)
    {
        const double c = seen.step_s[n] * std::cos(seen.heading_rad[n]);
        const double s = seen.step_s[n] * std::sin(seen.heading_rad[n]);
        const double along = left ? -s : c, aside = left ? c : s;
        const double *value = values.data() + n * width;
        for (size_t t = 0; t < width; ++t)
            sums[t] += along * value[t];
        for (size_t t = 0; t < width; ++t)
            sums[width + t] += aside * value[t];
        places.Keep(n, sums);
    }
    return ForEachWindow(
        seen, places, width,
        [&](const double *from, const double *to, double c, double s, double *out) {
            for (size_t t = 0; t < width; ++t)
            {
                const double x = to[t] - from[t];
                const double y = to[width + t] - from[width + t];
                out[t] = c * x + s * y;
                out[width + t] = c * y - s * x;
                out[2 * width + t] = 0;
            }
        });
}

// By turning rates (N, T), to first order, of a robot that moves at `velocity` (N, 3).
std::unique_ptr<double[]> DisplacedByTurning(Matrix values, Matrix velocity, const Seen &seen)
{
    const size_t count = values.shape(0), width = values.shape(1);
    std::vector<double> sums(3 * width + 2);  // angle, x, y; x and y of the robot turned left
    Places places(seen, sums.size());
    for (size_t n = 0; n < count; ++n)
    {
        const double *v = velocity.data() + 3 * n, *value = values.data() + n * width;
        const double c = std::cos(seen.heading_rad[n]), s = std::sin(seen.heading_rad[n]);
        const double step = seen.step_s[n];
        const double x = -step * (s * v[0] + c * v[1]), y = step * (c * v[0] - s * v[1]);
        for (size_t t = 0; t < width; ++t)
        {
            const double turned = step * value[t], middle = sums[t] + turned / 2;
            sums[t] += turned;
            sums[width + t] += x * middle;
            sums[2 * width + t] += y * middle;
        }
        sums[3 * width] += x;
        sums[3 * width + 1] += y;
        places.Keep(n, sums);
    }
    return ForEachWindow(
        seen, places, width,
        [&](const double *from, const double *to, double c, double s, double *out) {
            const double x_m = to[3 * width] - from[3 * width];
            const double y_m = to[3 * width + 1] - from[3 * width + 1];
            for (size_t t = 0; t < width; ++t)
            {
                const double x = to[width + t] - from[width + t] - from[t] * x_m;
                const double y = to[2 * width + t] - from[2 * width + t] - from[t] * y_m;
                out[t] = c * x + s * y;
                out[width + t] = c * y - s * x;
                out[2 * width + t] = to[t] - from[t];
            }
        });
}

Array DisplacedBy(Matrix values, Matrix velocity, int axis, Vector step_s, Vector heading_rad,
                  Indices starts, IndexMatrix ends, Vector at_rad)
{
    const size_t count = values.shape(0);
    if (step_s.size() != count || heading_rad.size() != count || velocity.shape(0) != count ||
        velocity.shape(1) != 3)
        throw std::invalid_argument(
            "velocity must be (N, 3), steps and headings (N), as many as rows of values");
    if (ends.shape(0) != starts.size() || at_rad.size() != starts.size())
        throw std::invalid_argument("ends and first headings must have one row per start");
    const Seen seen{Span(step_s), Span(heading_rad), Span(at_rad), Span(starts), Span(ends)};
    auto displaced = axis < 2 ? DisplacedByDriving(values, seen, axis == 1)
                              : DisplacedByTurning(values, velocity, seen);
    return ToNumpy(std::move(displaced), {starts.size(), ends.shape(1), 3, values.shape(1)});
}

// A signal (G, C) at a place between two of its rows; beyond its ends it goes on as it is there.
class Read
{
public:
    explicit Read(Matrix signal) : signal_(signal), width_(signal.shape(1)) {}

    // Calls visit(c, value) for each column.
    template <class Visit>
    void At(double place, Visit visit) const
    {
        const double within = std::clamp(place, 0.0, static_cast<double>(signal_.shape(0)) - 1.001);
        const auto row = static_cast<size_t>(within);
        const double part = within - static_cast<double>(row);
        const double *from = signal_.data() + row * width_;
        for (size_t c = 0; c < width_; ++c)
            visit(c, from[c] * (1 - part) + from[width_ + c] * part);
    }

private:
    Matrix signal_;
    size_t width_;
};

// (2, S, B, C) sums over stretches, which begin at rows `begins` of places (K,), of a signal's
// columns that are read `shifts` (S,) before these: of their squares, and of their products with
// the columns of `beside` (K, W), over and over.
Array SumsByShift(Matrix signal, Vector places, Vector shifts, Matrix beside, Indices begins)
{
    const size_t count = places.size(), width = signal.shape(1), across = beside.shape(1);
    const size_t stretches = begins.size();
    if (signal.shape(0) < 2 || beside.shape(0) != count || across == 0)
        throw std::invalid_argument(
            "the signal must have two rows or more, and as many rows stand beside it as places");
    const auto begin = [&](size_t b) {
        return b < stretches ? static_cast<size_t>(begins.data()[b]) : count;
    };
    for (size_t b = 0; b < stretches; ++b)
        if (begin(b) > begin(b + 1) || begin(b) > count)
            throw std::invalid_argument("stretches must begin one after the other, at places");
    const Read read(signal);
    const size_t size = shifts.size() * stretches * width;
    std::vector<double> sums(2 * size);
    double *square = sums.data(), *product = square + size;
    for (size_t s = 0; s < shifts.size(); ++s)
        for (size_t b = 0; b < stretches; ++b, square += width, product += width)
            for (size_t k = begin(b); k < begin(b + 1); ++k)
            {
                const double *other = beside.data() + k * across;
                read.At(places.data()[k] - shifts.data()[s], [&](size_t c, double value) {
                    square[c] += value * value;
                    product[c] += value * other[c % across];
                });
            }
    return ToNumpy(std::move(sums), {2, shifts.size(), stretches, width});
}

Array Filtered(Vector numerator, Vector denominator, Matrix signal)
{
    const size_t count = signal.shape(0), width = signal.shape(1);
    std::vector<double> out(count * width);
    for (size_t n = 0; n < count; ++n)
    {
        double *now = out.data() + n * width;
        const auto add = [&](double share, const double *values) {
            for (size_t f = 0; f < width; ++f)
                now[f] += share * values[f];
        };
        for (size_t k = 0; k < std::min(numerator.size(), n + 1); ++k)
            add(numerator.data()[k], signal.data() + (n - k) * width);
        for (size_t k = 1; k < std::min(denominator.size(), n + 1); ++k)
            add(-denominator.data()[k], now - k * width);
    }
    return ToNumpy(std::move(out), {count, width});
}

Array Faded(Vector keep, Vector pushes)
{
    if (keep.size() != pushes.size())
        throw std::invalid_argument("there must be as many shares as pushes");
    std::vector<double> out(pushes.size());
    double last = 0;
    for (size_t n = 0; n < out.size(); ++n)
        out[n] = last = keep.data()[n] * last + pushes.data()[n];
    return ToNumpy(std::move(out), {pushes.size()});
}

Array Held(Vector values, double least)
{
    std::vector<double> taken(values.size());
    double now = 0;
    for (size_t n = 0; n < taken.size(); ++n)
    {
        if (std::abs(values.data()[n] - now) > least)
            now = values.data()[n];
        taken[n] = now;
    }
    return ToNumpy(std::move(taken), {values.size()});
}

Array Wound(Vector way, double most)
{
    std::vector<double> wound(way.size());
    double now = 0;
    for (size_t n = 0; n < wound.size(); ++n)
        wound[n] = now = std::clamp(now + way.data()[n] / most, -1.0, 1.0);
    return ToNumpy(std::move(wound), {way.size()});
}

// s and r = ds/dt at the end of each step, from rest: dr/dt = w^2 (push - s) - 2 z w r.
Array Swung(Vector pushes, Vector step_s, double rate, double damping)
{
    if (step_s.size() != pushes.size())
        throw std::invalid_argument("there must be as many steps as pushes");
    const double fast = rate * std::sqrt(1 - damping * damping), fading = damping * rate;
    std::vector<double> out(2 * pushes.size());
    double *mean_s = out.data(), *mean_r = mean_s + pushes.size();
    double s = 0, r = 0, last_s = -1, cos = 0, sin = 0;
    for (size_t n = 0; n < pushes.size(); ++n)
    {
        const double dt_s = step_s.data()[n], push = pushes.data()[n];
        if (dt_s <= 0)
        {
            mean_s[n] = s;
            mean_r[n] = r;
            continue;
        }
        if (dt_s != last_s)
        {
            const double fade = std::exp(-fading * dt_s);
            cos = fade * std::cos(fast * dt_s);
            sin = fade * std::sin(fast * dt_s) / fast;
            last_s = dt_s;
        }
        const double away = s - push, from_s = s, from_r = r;
        s = push + (cos + fading * sin) * away + sin * r;
        r = (cos - fading * sin) * r - rate * rate * sin * away;
        const double moved = s - from_s,
                     speeding = (r - from_r + 2 * damping * rate * moved) / dt_s;
        mean_s[n] = push - speeding / (rate * rate);
        mean_r[n] = moved / dt_s;
    }
    return ToNumpy(std::move(out), {2, pushes.size()});
}

}  // namespace

void BindSeries(nb::module_ &m)
{
    m.def("displaced_by", &DisplacedBy, "values"_a, "velocity"_a, "axis"_a, "step_s"_a,
          "heading_rad"_a, "starts"_a, "ends"_a, "at_rad"_a,
          "(W, H, 3, T) how far a robot that moves at `velocity` (N, 3) gets elsewhere, forward, "
          "left and turned as seen from headings `at_rad` (W,), from after row `starts` (W,) up to "
          "row `ends` (W, H), by other speeds (N, T) in a body axis: 0, 1, or 2 for turning, of "
          "first order.");
    m.def("filtered", &Filtered, "numerator"_a, "denominator"_a, "signal"_a,
          "(N, F) of a recursive filter that begins at rest.");
    m.def("faded", &Faded, "keep"_a, "pushes"_a,
          "(N,) y[n] = keep[n] y[n - 1] + pushes[n], from rest.");
    m.def("held", &Held, "values"_a, "least"_a,
          "(N,) values of which changes below a least one are not taken, from 0.");
    m.def("wound", &Wound, "way"_a, "most"_a,
          "(N,) how far something is wound up by steps of way, -1 to 1: by `most` it is wholly.");
    m.def(
        "sums_by_shift", &SumsByShift, "signal"_a, "places"_a, "shifts"_a, "beside"_a, "begins"_a,
        "(2, S, B, C) sums over stretches of places (K,), which begin at `begins` (B,), of what a "
        "signal (G, C) is at places less `shifts` (S,): of its squares, and of its products with "
        "the columns `beside` (K, W), over and over.");
    m.def("swung", &Swung, "pushes"_a, "step_s"_a, "rate"_a, "damping"_a,
          "(2, N) means of s and of ds/dt over each step, from rest, of what swings around each "
          "push; a step of no length leaves both as they are.");
    m.def("led_between", &LedBetween, "forward"_a, "left"_a, "steps"_a, "starts"_a, "ends"_a,
          "direction"_a,
          "(R, F) how far each forward and left velocity leads along a `direction` (R, 2) from "
          "after row `starts` (R,) up to row `ends` (R,): `steps` (N, 2) are the length of each "
          "step times the direction in which the robot heads. Or with `steps` (N, 1) of no "
          "direction, `direction` (R, 1) and no left velocities: how far each forward one leads. "
          "Velocities are pairs side by side: gains (N, k), each times each of signals (N, m).");
}

}  // namespace twin
