// SPDX-License-Identifier: Apache-2.0
// Sums and filters over time of many columns at once, row by row and not value by value.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include "arrays.h"

using namespace nanobind::literals;

namespace twin
{
namespace
{

constexpr size_t kNoPlace = SIZE_MAX;
constexpr size_t kRows = 16;  // that are made at once

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

// Several products side by side, written for some rows at once.
class Columns
{
public:
    Columns(const std::vector<Product> &products, size_t count) : products_(products)
    {
        for (const auto &[gains, signals] : products)
        {
            if (gains.shape(0) != count || signals.shape(0) != count)
                throw std::invalid_argument(
                    "steps must be as many as rows of gains and of signals");
            width_ += gains.shape(1) * signals.shape(1);
        }
    }

    size_t Width() const { return width_; }

    // Rows first to last, so many values apart.
    void Write(size_t first, size_t last, size_t apart, double *out) const
    {
        for (const auto &[gains, signals] : products_)
        {
            const size_t width = gains.shape(1), count = signals.shape(1);
            const double *gain = gains.data() + first * width;
            const double *signal = signals.data() + first * count;
            if (width == 2)  // as most are: a cosine and a sine
                WriteRows<2>(gain, signal, width, count, last - first, apart, out);
            else
                WriteRows<0>(gain, signal, width, count, last - first, apart, out);
            out += width * count;
        }
    }

private:
    // Gains of a width that is known before, or 0.
    template <size_t kWidth>
    static void WriteRows(const double *gain, const double *signal, size_t width, size_t count,
                          size_t rows, size_t apart, double *out)
    {
        if constexpr (kWidth > 0)
            width = kWidth;
        for (size_t n = 0; n < rows; ++n, gain += width, signal += count, out += apart)
            for (size_t k = 0; k < count; ++k)
                Times(gain, width, signal[k], out + k * width);
    }

    // Two at a time.
    static void Times(const double *gain, size_t width, double signal, double *out)
    {
        size_t f = 0;
        for (; f + 2 <= width; f += 2)
        {
            const double pair[2] = {gain[f] * signal, gain[f + 1] * signal};
            std::copy_n(pair, 2, out + f);
        }
        if (f < width)
            out[f] = gain[f] * signal;
    }

    const std::vector<Product> &products_;
    size_t width_ = 0;
};

// Adds steps (N, ways) times rows (N, F), for a few of the columns, which stay in registers, to
// sums (ways, F) `from`, and writes these sums.
template <size_t kWays, size_t kFew>
void AddFew(const double *steps, const double *rows, size_t count, size_t width, const double *from,
            double *to)
{
    double sums[kWays][kFew];
    for (size_t k = 0; k < kWays; ++k)
        std::copy_n(from + k * width, kFew, sums[k]);
    for (size_t n = 0; n < count; ++n, steps += kWays, rows += width)
        for (size_t k = 0; k < kWays; ++k)
            for (size_t f = 0; f < kFew; ++f)
                sums[k][f] += steps[k] * rows[f];
    for (size_t k = 0; k < kWays; ++k)
        std::copy_n(sums[k], kFew, to + k * width);
}

// The same for all columns.
template <size_t kWays>
void Add(const double *steps, const double *rows, size_t count, size_t width, const double *from,
         double *to)
{
    constexpr size_t kFew = 4;
    size_t f = 0;
    for (; f + kFew <= width; f += kFew)
        AddFew<kWays, kFew>(steps, rows + f, count, width, from + f, to + f);
    for (; f < width; ++f)
        AddFew<kWays, 1>(steps, rows + f, count, width, from + f, to + f);
}

// Sums (ways, F) of columns times steps (N, ways) up to each row that has a place, which becomes
// where they are.
template <size_t kWays>
std::unique_ptr<double[]> SumUpTo(std::vector<size_t> &place, const double *steps,
                                  const Columns &before, const Columns &beside)
{
    const size_t width = before.Width() + beside.Width(), apart = kWays * width;
    const auto places = static_cast<size_t>(std::ranges::count(place, 0U));
    auto kept = std::make_unique_for_overwrite<double[]>((places + 2) * apart);
    std::vector<double> rows(kRows * width);
    const double *from = kept.get();
    double *to = std::fill_n(kept.get(), apart, 0.0);
    for (size_t first = 0; first < place.size(); first += kRows)
    {
        const size_t last = std::min(first + kRows, place.size());
        before.Write(first, last, width, rows.data());
        beside.Write(first, last, width, rows.data() + before.Width());
        for (size_t n = first; n < last;)
        {
            const size_t begin = n;
            while (n < last && place[n++] == kNoPlace)
                ;
            Add<kWays>(steps + kWays * begin, rows.data() + (begin - first) * width, n - begin,
                       width, from, to);
            from = to;
            if (place[n - 1] == kNoPlace)
                continue;
            place[n - 1] = static_cast<size_t>(to - kept.get());
            to += apart;
        }
    }
    return kept;
}

// Writes what lies between two sums of a count of values, of each along both axes of the plane,
// the second axis' so many places behind: along a direction.
void WriteBetween(const double *from, const double *to, size_t count, size_t behind, double x,
                  double y, double *out)
{
    for (size_t f = 0; f < count; ++f)
        out[f] = x * (to[f] - from[f]) + y * (to[behind + f] - from[behind + f]);
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
    const Columns before(forward, count), beside(left, count);
    const size_t ahead = before.Width(), aside = beside.Width(), width = ahead + aside;
    std::vector<size_t> place = Wanted(count, {Span(starts), Span(ends)});
    const auto kept = ways == 2 ? SumUpTo<2>(place, steps.data(), before, beside)
                                : SumUpTo<1>(place, steps.data(), before, beside);
    auto led = std::make_unique_for_overwrite<double[]>(rows * width);
    for (size_t r = 0; r < rows; ++r)
    {
        const double *from = kept.get() + place[static_cast<size_t>(starts.data()[r])];
        const double *to = kept.get() + place[static_cast<size_t>(ends.data()[r])];
        const double *along = direction.data() + ways * r;
        double *out = led.get() + r * width;
        if (ways == 2)
        {
            WriteBetween(from, to, ahead, width, along[0], along[1], out);
            WriteBetween(from + ahead, to + ahead, aside, width, along[1], -along[0], out + ahead);
        }
        else
            for (size_t f = 0; f < width; ++f)
                out[f] = along[0] * (to[f] - from[f]);
    }
    return ToNumpy(std::move(led), {rows, width});
}

// A motion over N steps, and the windows (W, H) in which it is seen.
struct Seen
{
    std::span<const double> step_s, ahead, at_rad;  // (N), (N, 2) cosine and sine, (W)
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
        const double c = seen.step_s[n] * seen.ahead[2 * n];
        const double s = seen.step_s[n] * seen.ahead[2 * n + 1];
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
        const double c = seen.ahead[2 * n], s = seen.ahead[2 * n + 1], step = seen.step_s[n];
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

Array DisplacedBy(Matrix values, Matrix velocity, int axis, Vector step_s, Matrix ahead,
                  Indices starts, IndexMatrix ends, Vector at_rad)
{
    const size_t count = values.shape(0);
    if (step_s.size() != count || ahead.shape(0) != count || ahead.shape(1) != 2 ||
        velocity.shape(0) != count || velocity.shape(1) != 3)
        throw std::invalid_argument(
            "velocity must be (N, 3), `ahead` (N, 2) and steps (N), as many as rows of values");
    if (ends.shape(0) != starts.size() || at_rad.size() != starts.size())
        throw std::invalid_argument("ends and first headings must have one row per start");
    const Seen seen{Span(step_s), Span(ahead), Span(at_rad), Span(starts), Span(ends)};
    auto displaced = axis < 2 ? DisplacedByDriving(values, seen, axis == 1)
                              : DisplacedByTurning(values, velocity, seen);
    return ToNumpy(std::move(displaced), {starts.size(), ends.shape(1), 3, values.shape(1)});
}

// Sums about one time of the times near it and of C columns there, from which its lines follow.
class Near
{
public:
    explicit Near(size_t width) : y_(width), ty_(width) {}

    void Clear()
    {
        s0_ = s1_ = s2_ = 0;
        std::ranges::fill(y_, 0.0);
        std::ranges::fill(ty_, 0.0);
    }

    void Add(double dt, const double *own, const double *other)
    {
        s0_ += 1;
        s1_ += dt;
        s2_ += dt * dt;
        for (size_t c = 0; c < y_.size(); ++c)
        {
            const double dy = other[c] - own[c];
            y_[c] += dy;
            ty_[c] += dt * dy;
        }
    }

    // NaN for a slope where the time stands alone.
    void WriteLines(const double *own, double *value, double *slope) const
    {
        const double determinant = s0_ * s2_ - s1_ * s1_;
        for (size_t c = 0; c < y_.size(); ++c)
        {
            value[c] = own[c];
            if (determinant <= 0)
                continue;
            value[c] += (s2_ * y_[c] - s1_ * ty_[c]) / determinant;
            slope[c] = (s0_ * ty_[c] - s1_ * y_[c]) / determinant;
        }
    }

private:
    double s0_ = 0, s1_ = 0, s2_ = 0;
    std::vector<double> y_, ty_;
};

// (2, N, C) value and slope there of a straight line by least squares around each of N times, of
// the columns of values (N, C): of times within `half_width` and `reach` rows, and of one segment.
Array LocalLines(Vector times, Matrix values, Indices segments, double half_width, size_t reach)
{
    const size_t count = times.size(), width = values.shape(1);
    if (values.shape(0) != count || segments.size() != count)
        throw std::invalid_argument("values and segments must have one row per time");
    const double *t = times.data();
    const int64_t *segment = segments.data();
    std::vector<double> lines(2 * count * width, std::numeric_limits<double>::quiet_NaN());
    Near near(width);
    for (size_t n = 0; n < count; ++n)
    {
        if (segment[n] < 0)
            continue;
        const double *own = values.data() + n * width;
        near.Clear();
        for (size_t k = n - std::min(n, reach); k < std::min(n + reach + 1, count); ++k)
            if (segment[k] == segment[n] && std::abs(t[k] - t[n]) <= half_width)
                near.Add(t[k] - t[n], own, values.data() + k * width);
        near.WriteLines(own, lines.data() + n * width, lines.data() + (count + n) * width);
    }
    return ToNumpy(std::move(lines), {2, count, width});
}

// Where a signal is read between two of its rows; beyond its ends it goes on as it is there.
struct Between
{
    size_t row;
    double part;

    Between(double place, size_t rows)
    {
        const double within = std::clamp(place, 0.0, static_cast<double>(rows) - 1.001);
        row = static_cast<size_t>(within);
        part = within - static_cast<double>(row);
    }

    double Of(double from, double to) const { return from * (1 - part) + to * part; }
};

// (K, C) of a signal (G, C) at places (K,).
Array ReadAt(Matrix signal, Vector places)
{
    const size_t rows = signal.shape(0), width = signal.shape(1);
    if (rows < 2)
        throw std::invalid_argument("the signal must have two rows or more");
    auto values = std::make_unique_for_overwrite<double[]>(places.size() * width);
    double *value = values.get();
    for (const double place : Span(places))
    {
        const Between here(place, rows);
        const double *from = signal.data() + here.row * width, *to = from + width;
        for (size_t c = 0; c < width; ++c)
            *value++ = here.Of(from[c], to[c]);
    }
    return ToNumpy(std::move(values), {places.size(), width});
}

constexpr size_t kBeside = 3;  // columns beside a signal

// Sums over places of squares of kBeside of a signal's columns, the first of which is `first` (G,
// C), and of their products with what stands beside each place.
void SumProducts(std::span<const Between> at, const double *first, size_t width,
                 const double *beside, double *squares, double *products)
{
    std::array<double, kBeside> square{}, product{};
    for (const Between &here : at)
    {
        const double *from = first + here.row * width, *to = from + width;
        for (size_t c = 0; c < kBeside; ++c)
        {
            const double value = here.Of(from[c], to[c]);
            square[c] += value * value;
            product[c] += value * beside[c];
        }
        beside += kBeside;
    }
    std::ranges::copy(square, squares);
    std::ranges::copy(product, products);
}

// (2, S, B, C) sums over stretches, which begin at rows `begins` of places (K,), of a signal's
// columns that are read `shifts` (S,) before these: of their squares, and of their products with
// the columns of `beside` (K, 3), over and over.
Array SumsByShift(Matrix signal, Vector places, Vector shifts, Matrix beside, Indices begins)
{
    const size_t count = places.size(), rows = signal.shape(0), width = signal.shape(1);
    const size_t stretches = begins.size();
    if (rows < 2 || beside.shape(0) != count || beside.shape(1) != kBeside || width % kBeside)
        throw std::invalid_argument(
            "the signal must have two rows or more, its columns those of "
            "`beside` over and over, and these as many rows as places");
    const auto begin = [&](size_t b) {
        return b < stretches ? static_cast<size_t>(begins.data()[b]) : count;
    };
    for (size_t b = 0; b < stretches; ++b)
        if (begin(b) > begin(b + 1) || begin(b) > count)
            throw std::invalid_argument("stretches must begin one after the other, at places");
    const size_t size = shifts.size() * stretches * width;
    auto sums = std::make_unique_for_overwrite<double[]>(2 * size);
    double *square = sums.get(), *product = square + size;
    std::vector<Between> at;
    for (const double shift : Span(shifts))
    {
        at.clear();
        for (const double place : Span(places))
            at.emplace_back(place - shift, rows);
        for (size_t b = 0; b < stretches; ++b)
            for (size_t c = 0; c < width; c += kBeside, square += kBeside, product += kBeside)
                SumProducts(std::span(at).subspan(begin(b), begin(b + 1) - begin(b)),
                            signal.data() + c, width, beside.data() + begin(b) * kBeside, square,
                            product);
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

Array Faded(Matrix keep, Matrix pushes)
{
    const size_t count = pushes.shape(0), width = pushes.shape(1);
    if (keep.shape(0) != count || keep.shape(1) != width)
        throw std::invalid_argument("there must be as many shares as pushes");
    auto faded = std::make_unique_for_overwrite<double[]>(count * width);
    std::vector<double> last(width);
    for (size_t n = 0; n < count; ++n)
        for (size_t f = 0; f < width; ++f)
        {
            const size_t at = n * width + f;
            faded[at] = last[f] = keep.data()[at] * last[f] + pushes.data()[at];
        }
    return ToNumpy(std::move(faded), {count, width});
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

// (N, 2) by what a swing turns and fades over each step: cosine, and sine over its rate.
Array SwingOf(Vector step_s, double rate, double damping)
{
    const double fast = rate * std::sqrt(1 - damping * damping), fading = damping * rate;
    std::vector<double> turned;
    turned.reserve(2 * step_s.size());
    for (const double dt_s : Span(step_s))
    {
        const double fade = std::exp(-fading * dt_s);
        turned.push_back(fade * std::cos(fast * dt_s));
        turned.push_back(fade * std::sin(fast * dt_s) / fast);
    }
    return ToNumpy(std::move(turned), {step_s.size(), 2});
}

// s and r = ds/dt at the end of each step, from rest: dr/dt = w^2 (push - s) - 2 z w r.
Array Swung(Vector pushes, Vector step_s, Matrix turned, double rate, double damping)
{
    if (step_s.size() != pushes.size() || turned.shape(0) != pushes.size() || turned.shape(1) != 2)
        throw std::invalid_argument("there must be as many steps as pushes, and what each turns");
    const double fading = damping * rate;
    std::vector<double> out(2 * pushes.size());
    double *mean_s = out.data(), *mean_r = mean_s + pushes.size();
    double s = 0, r = 0;
    for (size_t n = 0; n < pushes.size(); ++n)
    {
        const double dt_s = step_s.data()[n], push = pushes.data()[n];
        if (dt_s <= 0)
        {
            mean_s[n] = s;
            mean_r[n] = r;
            continue;
        }
        const double cos = turned.data()[2 * n], sin = turned.data()[2 * n + 1];
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

constexpr size_t kTogether = 4;  // rows, that another row is loaded and stored for once

// Takes shares of a few rows (width apart) out of columns [begin, end) of another one.
template <size_t kFew>
void TakeOut(const double *share, const double *rows, size_t width, size_t begin, size_t end,
             double *row)
{
    for (size_t k = begin; k < end; ++k)
    {
        double left = row[k];
        for (size_t p = 0; p < kFew; ++p)
            left -= share[p] * rows[p * width + k];
        row[k] = left;
    }
}

// Takes the unknowns of a few rows from `first` on, which are done, out of row i.
template <size_t kFew>
void TakeUnknownsOut(double *rows, size_t width, size_t first, size_t i)
{
    const double *done = rows + first * width;
    double share[kFew];
    for (size_t p = 0; p < kFew; ++p)
        share[p] = done[p * width + i] / done[p * width + first + p];
    TakeOut<kFew>(share, done, width, i, width, rows + i * width);
}

// Solves the count equations in rows of count + 1, the last of each the right side: of a definite
// matrix, whose upper half alone is looked at.
void Eliminate(std::span<double> rows, size_t count, double *solution)
{
    const size_t width = count + 1;
    for (size_t i = 1; i < count; ++i)
    {
        size_t first = 0;
        for (; first + kTogether <= i; first += kTogether)
            TakeUnknownsOut<kTogether>(rows.data(), width, first, i);
        for (; first < i; ++first)
            TakeUnknownsOut<1>(rows.data(), width, first, i);
    }
    for (size_t j = count; j-- > 0;)
    {
        const double *row = rows.data() + j * width;
        double left = row[count];
        for (size_t k = j + 1; k < count; ++k)
            left -= row[k] * solution[k];
        solution[j] = left / row[j];
    }
}

Array SolvedRisen(Cube grams, Matrix rises, Matrix moments)
{
    const size_t matrices = grams.shape(0), count = grams.shape(1), trials = rises.shape(1);
    if (grams.shape(2) != count || rises.shape(0) != matrices || moments.shape(0) != matrices ||
        moments.shape(1) != count)
        throw std::invalid_argument(
            "there must be rises and a moment of each square matrix, and as long as its rows");
    std::vector<double> rows(count * (count + 1));
    auto solved = std::make_unique_for_overwrite<double[]>(matrices * trials * count);
    for (size_t m = 0; m < matrices; ++m)
        for (size_t t = 0; t < trials; ++t)
        {
            for (size_t i = 0; i < count; ++i)
            {
                double *row = rows.data() + i * (count + 1);
                std::copy_n(grams.data() + (m * count + i) * count, count, row);
                row[i] += rises.data()[m * trials + t];
                row[count] = moments.data()[m * count + i];
            }
            Eliminate(rows, count, solved.get() + (m * trials + t) * count);
        }
    return ToNumpy(std::move(solved), {matrices, trials, count});
}

// By row of a channel: the shares of a value, of the one before it, and of the two whitened before
// it, in a whitened value; and its weight.
struct Shares
{
    double own, before, last, one_before_last, weight;
};

// Whitens channel `rows` of a few columns, so many values apart, each to its own place.
template <size_t kFew>
void WhitenFew(std::span<const Shares> shares, const double *rows, size_t channels, size_t apart,
               double *out, size_t out_apart)
{
    double before[kFew] = {}, last[kFew] = {}, one_before_last[kFew] = {};
    for (const Shares &share : shares)
    {
        for (size_t k = 0; k < kFew; ++k)
        {
            const double value = rows[k * apart];
            const double known = share.own * value - share.before * before[k] -
                                 share.one_before_last * one_before_last[k];
            before[k] = value;
            one_before_last[k] = last[k];
            last[k] = known - share.last * last[k];
        }
        for (size_t k = 0; k < kFew; ++k)
            out[k * out_apart] = share.weight * last[k];
        rows += channels;
        ++out;
    }
}

// What AR leaves of columns, forward through the banded Cholesky factor of its covariance.
Array Whitened(Cube rows, Vector kept, Matrix low, const std::optional<Matrix> &weight)
{
    constexpr size_t kFew = 8;
    const size_t columns = rows.shape(0), count = rows.shape(1), channels = rows.shape(2),
                 width = count * channels;
    if (kept.size() != width || low.shape(0) != 3 || low.shape(1) != width ||
        (weight && weight->size() != width))
        throw std::invalid_argument("filter and weights must be as long as the rows of a column");
    const double *diagonal = low.data(), *first = diagonal + width, *second = first + width;
    auto white = std::make_unique_for_overwrite<double[]>(columns * width);
    std::vector<Shares> shares(count);
    for (size_t c = 0; c < channels; ++c)
    {
        for (size_t n = 0, at = c * count; n < count; ++n, ++at)
        {
            const double own = 1 / diagonal[at];
            shares[n] = {own, n > 0 ? own * kept.data()[at] : 0, n > 0 ? own * first[at - 1] : 0,
                         n > 1 ? own * second[at - 2] : 0, weight ? weight->data()[at] : 1};
        }
        const double *from = rows.data() + c;
        double *to = white.get() + c * count;
        size_t k = 0;
        for (; k + kFew <= columns; k += kFew)
            WhitenFew<kFew>(shares, from + k * width, channels, width, to + k * width, width);
        for (; k < columns; ++k)
            WhitenFew<1>(shares, from + k * width, channels, width, to + k * width, width);
    }
    return ToNumpy(std::move(white), {columns, width});
}

}  // namespace

void BindSeries(nb::module_ &m)
{
    m.def("displaced_by", &DisplacedBy, "values"_a, "velocity"_a, "axis"_a, "step_s"_a, "ahead"_a,
          "starts"_a, "ends"_a, "at_rad"_a,
          "(W, H, 3, T) how far a robot that moves at `velocity` (N, 3) gets elsewhere, forward, "
          "left and turned as seen from headings `at_rad` (W,), from after row `starts` (W,) up to "
          "row `ends` (W, H), by other speeds (N, T) in a body axis: 0, 1, or 2 for turning, of "
          "first order. `ahead` (N, 2) is the cosine and sine of its heading in each step.");
    m.def("filtered", &Filtered, "numerator"_a, "denominator"_a, "signal"_a,
          "(N, F) of a recursive filter that begins at rest.");
    m.def("faded", &Faded, "keep"_a, "pushes"_a,
          "(N, F) y[n] = keep[n] y[n - 1] + pushes[n], from rest.");
    m.def("held", &Held, "values"_a, "least"_a,
          "(N,) values of which changes below a least one are not taken, from 0.");
    m.def("wound", &Wound, "way"_a, "most"_a,
          "(N,) how far something is wound up by steps of way, -1 to 1: by `most` it is wholly.");
    m.def("local_lines", &LocalLines, "times"_a, "values"_a, "segments"_a, "half_width"_a,
          "reach"_a,
          "(2, N, C) value and slope of a line by least squares around each time (N,), of columns "
          "(N, C): of times within a half width and `reach` rows, in one segment (N,); NaN where "
          "that is below 0, the slope where a time stands alone, too.");
    m.def("read_at", &ReadAt, "signal"_a, "places"_a,
          "(K, C) what a signal (G, C) is at places (K,) between its rows.");
    m.def(
        "sums_by_shift", &SumsByShift, "signal"_a, "places"_a, "shifts"_a, "beside"_a, "begins"_a,
        "(2, S, B, C) sums over stretches of places (K,), which begin at `begins` (B,), of what a "
        "signal (G, C) is at places less `shifts` (S,): of its squares, and of its products with "
        "the columns `beside` (K, 3), over and over.");
    m.def("solved_risen", &SolvedRisen, "grams"_a, "rises"_a, "moments"_a,
          "(M, V, F) solutions of symmetric matrices (M, F, F), each with one of (M, V) added to "
          "its diagonal and definite then, for right sides (M, F).");
    m.def("swing_of", &SwingOf, "step_s"_a, "rate"_a, "damping"_a,
          "(N, 2) cosine, and sine over the rate, of what swings and fades over each step.");
    m.def("swung", &Swung, "pushes"_a, "step_s"_a, "turned"_a, "rate"_a, "damping"_a,
          "(2, N) means of s and of ds/dt over each step, from rest, of what swings around each "
          "push, by what it turns over each step; a step of no length leaves both as they are.");
    m.def(
        "whitened", &Whitened, "rows"_a, "kept"_a, "low"_a, "weight"_a = nb::none(),
        "(K, C W) columns (K, W, C), channel after channel: each row less the share `kept` (C W,) "
        "of the one before it, through the lower banded Cholesky factor (3, C W) of the "
        "covariance of what that leaves, times a weight (C, W).");
    m.def("led_between", &LedBetween, "forward"_a, "left"_a, "steps"_a, "starts"_a, "ends"_a,
          "direction"_a,
          "(R, F) how far each forward and left velocity leads along a `direction` (R, 2) from "
          "after row `starts` (R,) up to row `ends` (R,): `steps` (N, 2) are the length of each "
          "step times the direction in which the robot heads. Or with `steps` (N, 1) of no "
          "direction, `direction` (R, 1) and no left velocities: how far each forward one leads. "
          "Velocities are pairs side by side: gains (N, k), each times each of signals (N, m).");
}

}  // namespace twin
