// SPDX-License-Identifier: Apache-2.0
// Sums and filters over time of many columns at once, row by row and not value by value.
#include <nanobind/stl/optional.h>

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
    m.def("filtered", &Filtered, "numerator"_a, "denominator"_a, "signal"_a,
          "(N, F) of a recursive filter that begins at rest.");
    m.def("faded", &Faded, "keep"_a, "pushes"_a,
          "(N, F) y[n] = keep[n] y[n - 1] + pushes[n], from rest.");
    m.def("local_lines", &LocalLines, "times"_a, "values"_a, "segments"_a, "half_width"_a,
          "reach"_a,
          "(2, N, C) value and slope of a line by least squares around each time (N,), of columns "
          "(N, C): of times within a half width and `reach` rows, in one segment (N,); NaN where "
          "that is below 0, the slope where a time stands alone, too.");
    m.def(
        "sums_by_shift", &SumsByShift, "signal"_a, "places"_a, "shifts"_a, "beside"_a, "begins"_a,
        "(2, S, B, C) sums over stretches of places (K,), which begin at `begins` (B,), of what a "
        "signal (G, C) is at places less `shifts` (S,): of its squares, and of its products with "
        "the columns `beside` (K, 3), over and over.");
    m.def(
        "whitened", &Whitened, "rows"_a, "kept"_a, "low"_a, "weight"_a = nb::none(),
        "(K, C W) columns (K, W, C), channel after channel: each row less the share `kept` (C W,) "
        "of the one before it, through the lower banded Cholesky factor (3, C W) of the "
        "covariance of what that leaves, times a weight (C, W).");
}

}  // namespace twin
