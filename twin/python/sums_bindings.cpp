// SPDX-License-Identifier: Apache-2.0
// Sums over time of many columns at once, row by row and not value by value.
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <functional>

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

// Of all columns side by side.
size_t WidthOf(const std::vector<Matrix> &arrays, size_t count)
{
    size_t width = 0;
    for (const Matrix &values : arrays)
    {
        if (values.shape(0) != count)
            throw std::invalid_argument("weights must be as many as rows of values");
        width += values.shape(1);
    }
    return width;
}

// What numpy.cumsum does of weighted rows, row by row and not value by value.
Array RunningSums(Matrix values, Vector weights)
{
    const size_t count = values.shape(0), width = values.shape(1);
    if (weights.size() != count)
        throw std::invalid_argument("weights must be as many as rows of values");
    std::vector<double> sums(count * width), row(width);
    for (size_t n = 0; n < count; ++n)
    {
        const double weight = weights.data()[n], *value = values.data() + n * width;
        for (size_t f = 0; f < width; ++f)
            row[f] += weight * value[f];
        std::ranges::copy(row, sums.begin() + static_cast<std::ptrdiff_t>(n * width));
    }
    return ToNumpy(std::move(sums), {count, width});
}

// What is added from each start to each of its ends, from running sums at these places alone. The
// columns of several arrays stand side by side.
Array SumsBetween(const std::vector<Matrix> &arrays, Vector weights, Indices starts,
                  IndexMatrix ends)
{
    const size_t count = weights.size(), horizons = ends.shape(1);
    const size_t width = WidthOf(arrays, count);
    if (ends.shape(0) != starts.size())
        throw std::invalid_argument("ends must have one row per start");
    std::vector<size_t> place = Wanted(count, {Span(starts), Span(ends)});
    std::vector<double> sums, row(width);
    for (size_t n = 0; n < count; ++n)
    {
        const double weight = weights.data()[n];
        double *sum = row.data();
        for (const Matrix &values : arrays)
        {
            const double *value = values.data() + n * values.shape(1);
            for (size_t f = 0; f < values.shape(1); ++f)
                *sum++ += weight * value[f];
        }
        if (place[n] == kNoPlace)
            continue;
        place[n] = sums.size();
        sums.insert(sums.end(), row.begin(), row.end());
    }
    std::vector<double> between(ends.size() * width);
    for (size_t i = 0; i < ends.size(); ++i)
    {
        const double *from = sums.data() + place[static_cast<size_t>(starts.data()[i / horizons])];
        const double *to = sums.data() + place[static_cast<size_t>(ends.data()[i])];
        std::transform(to, to + width, from, between.data() + i * width, std::minus{});
    }
    return ToNumpy(std::move(between), {starts.size(), horizons, width});
}

// Adds a row of several arrays to sums with the weight c, and to those behind them with s.
double *AddRow(const std::vector<Matrix> &arrays, size_t n, double c, double s, double *sum)
{
    for (const Matrix &values : arrays)
    {
        const size_t width = values.shape(1);
        const double *value = values.data() + n * width;
        for (size_t f = 0; f < width; ++f)
            sum[f] += c * value[f];
        sum += width;
        for (size_t f = 0; f < width; ++f)
            sum[f] += s * value[f];
        sum += width;
    }
    return sum;
}

// Writes along * (sum of c v) + aside * (sum of s v) of what lies between two sums.
double *WriteBetween(const std::vector<Matrix> &arrays, const double *&from, const double *&to,
                     double along, double aside, double *out)
{
    for (const Matrix &values : arrays)
    {
        const size_t width = values.shape(1);
        for (size_t f = 0; f < width; ++f)
            out[f] = along * (to[f] - from[f]) + aside * (to[width + f] - from[width + f]);
        from += 2 * width;
        to += 2 * width;
        out += width;
    }
    return out;
}

// How far velocities lead a robot along a direction of the plane, from each start to its end.
Array LedBetween(const std::vector<Matrix> &forward, const std::vector<Matrix> &left, Matrix steps,
                 Indices starts, Indices ends, Matrix direction)
{
    const size_t count = steps.shape(0), rows = starts.size();
    if (steps.shape(1) != 2 || direction.shape(1) != 2)
        throw std::invalid_argument("steps and directions must have two columns");
    if (ends.size() != rows || direction.shape(0) != rows)
        throw std::invalid_argument("ends and directions must be as many as starts");
    const size_t width = WidthOf(forward, count) + WidthOf(left, count);
    std::vector<size_t> place = Wanted(count, {Span(starts), Span(ends)});
    std::vector<double> sums, row(2 * width);
    for (size_t n = 0; n < count; ++n)
    {
        const double c = steps.data()[2 * n], s = steps.data()[2 * n + 1];
        AddRow(left, n, -s, c, AddRow(forward, n, c, s, row.data()));
        if (place[n] == kNoPlace)
            continue;
        place[n] = sums.size();
        sums.insert(sums.end(), row.begin(), row.end());
    }
    std::vector<double> led(rows * width);
    for (size_t r = 0; r < rows; ++r)
    {
        const double *from = sums.data() + place[static_cast<size_t>(starts.data()[r])];
        const double *to = sums.data() + place[static_cast<size_t>(ends.data()[r])];
        const double along = direction.data()[2 * r], aside = direction.data()[2 * r + 1];
        WriteBetween(left, from, to, along, aside,
                     WriteBetween(forward, from, to, along, aside, led.data() + r * width));
    }
    return ToNumpy(std::move(led), {rows, width});
}

}  // namespace

void BindSums(nb::module_ &m)
{
    m.def("running_sums", &RunningSums, "values"_a, "weights"_a,
          "(N, F) sums of rows of values (N, F), each times its weight (N,), up to each.");
    m.def("sums_between", &SumsBetween, "values"_a, "weights"_a, "starts"_a, "ends"_a,
          "(W, H, F) sums of rows of all values (N, f) side by side, each times its weight (N,), "
          "from after row `starts` (W,) up to row `ends` (W, H).");
    m.def("led_between", &LedBetween, "forward"_a, "left"_a, "steps"_a, "starts"_a, "ends"_a,
          "direction"_a,
          "(R, F) how far each forward and left velocity, (N, f) side by side, leads along a "
          "`direction` (R, 2) from after row `starts` (R,) up to row `ends` (R,): `steps` (N, 2) "
          "are the length of each step times the direction in which the robot heads.");
}

}  // namespace twin
