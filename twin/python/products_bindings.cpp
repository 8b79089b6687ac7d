// SPDX-License-Identifier: Apache-2.0
// Products of many columns, block of rows by block.
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "add_rows.h"
#include "arrays.h"

using namespace nanobind::literals;

namespace twin
{
namespace
{

using Columns = nb::ndarray<const double, nb::ndim<2>, nb::device::cpu>;  // maybe of a wider one

// First rows of B blocks, and the end.
std::span<const int64_t> Begins(Indices edges, size_t rows)
{
    const auto begins = Span(edges);
    if (begins.empty() || begins.front() < 0 || !std::ranges::is_sorted(begins) ||
        static_cast<size_t>(begins.back()) > rows)
        throw std::invalid_argument("blocks must begin one after the other, at rows");
    return begins;
}

void AskSideBySide(const Columns &columns)
{
    if (columns.shape(1) > 1 && columns.stride(1) != 1)
        throw std::invalid_argument("columns must stand side by side");
}

const double *Row(const Columns &columns, size_t r)
{
    return columns.data() + static_cast<int64_t>(r) * columns.stride(0);
}

// Of columns (R, T) with those beside them (R, P), and at the end with themselves.
Array ProductsBeside(Columns columns, Matrix beside, Vector weight, Indices edges)
{
    const size_t rows = columns.shape(0), width = columns.shape(1), count = beside.shape(1);
    if (beside.shape(0) != rows || weight.size() != rows)
        throw std::invalid_argument("columns, those beside them and weights must be as long");
    AskSideBySide(columns);
    const auto begins = Begins(edges, rows);
    std::vector<double> products((begins.size() - 1) * (count + 1) * width);
    double *out = products.data();
    const auto apart = static_cast<size_t>(columns.stride(0));
    for (size_t b = 0; b + 1 < begins.size(); ++b)
    {
        const auto first = static_cast<size_t>(begins[b]),
                   last = static_cast<size_t>(begins[b + 1]);
        for (size_t p = 0; p < count; ++p, out += width)
            AddRows({out, width}, {beside.data() + first * count + p, last - first, count},
                    Row(columns, first), apart);
        for (size_t r = first; r < last; ++r)
        {
            const double *row = Row(columns, r), square = weight.data()[r] * weight.data()[r];
            for (size_t t = 0; t < width; ++t)
                out[t] += square * row[t] * row[t];
        }
        out += width;
    }
    return ToNumpy(std::move(products), {begins.size() - 1, count + 1, width});
}

// Reads some of the columns that stand in pieces, at the rows of one block.
class Reader
{
public:
    explicit Reader(const std::vector<Columns> &pieces)
    {
        for (const Columns &piece : pieces)
            for (size_t t = 0; t < piece.shape(1); ++t)
                columns_.emplace_back(piece.data() + t, piece.stride(0));
    }

    size_t Count() const { return columns_.size(); }

    // (k, rows) of columns of these numbers, weighted and less along (P, T) times basis (P, R).
    void Read(std::span<const int64_t> places, size_t first, size_t last, Vector weight,
              Matrix basis, Matrix along, std::vector<double> &left) const
    {
        const size_t rows = last - first, count = basis.shape(0), width = basis.shape(1);
        left.assign(places.size() * rows, 0.0);
        for (size_t k = 0; k < places.size(); ++k)
        {
            const auto place = static_cast<size_t>(places[k]);
            const std::span own(left.data() + k * rows, rows);
            AddRows(own, {along.data() + place, count, Count()}, basis.data() + first, width);
            const auto [column, apart] = columns_[place];
            const double *value = column + static_cast<int64_t>(first) * apart;
            for (size_t r = 0; r < rows; ++r, value += apart)
                own[r] = weight.data()[first + r] * *value - own[r];
        }
    }

private:
    std::vector<std::pair<const double *, int64_t>> columns_;
};

// Sums four values apart, which the processor adds side by side.
double Product(const double *one, const double *other, size_t count)
{
    std::array<double, 4> sums{};
    size_t r = 0;
    for (; r + 4 <= count; r += 4)
        for (size_t n = 0; n < 4; ++n)
            sums[n] += one[r + n] * other[r + n];
    for (; r < count; ++r)
        sums[0] += one[r] * other[r];
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

// Of columns (k, rows) with each other.
void WriteProducts(const std::vector<double> &columns, size_t width, double *out)
{
    const size_t rows = columns.size() / width;
    for (size_t k = 0; k < width; ++k)
        for (size_t j = k; j < width; ++j)
            out[k * width + j] = out[j * width + k] =
                Product(columns.data() + k * rows, columns.data() + j * rows, rows);
}

// Block by block: rows of a block are read for all sets of columns while they are near.
Array ProductsLeft(const std::vector<Columns> &pieces, IndexMatrix places, Vector weight,
                   Matrix basis, Matrix along, Indices edges)
{
    const size_t sets = places.shape(0), width = places.shape(1), rows = weight.size();
    for (const Columns &piece : pieces)
    {
        AskSideBySide(piece);
        if (piece.shape(0) != rows || basis.shape(1) != rows)
            throw std::invalid_argument("columns, basis and weights must be as long");
    }
    const Reader reader(pieces);
    for (const int64_t place : Span(places))
        if (place < 0 || static_cast<size_t>(place) >= reader.Count())
            throw std::invalid_argument("places must be of columns");
    if (along.shape(0) != basis.shape(0) || along.shape(1) != reader.Count())
        throw std::invalid_argument("`along` must have what each column has of the basis");
    const auto begins = Begins(edges, rows);
    const size_t blocks = begins.size() - 1, square = width * width;
    std::vector<double> products(sets * blocks * square), left;
    for (size_t b = 0; b < blocks; ++b)
        for (size_t n = 0; n < sets; ++n)
        {
            reader.Read(Span(places).subspan(n * width, width), static_cast<size_t>(begins[b]),
                        static_cast<size_t>(begins[b + 1]), weight, basis, along, left);
            WriteProducts(left, width, products.data() + (n * blocks + b) * square);
        }
    return ToNumpy(std::move(products), {sets, blocks, width, width});
}

// A normal model's covariance 1 + size^2 Gram: its Cholesky factor, and products through it.
class Sized
{
public:
    Sized(const Matrix &gram, double size) : count_(gram.shape(0)), low_(count_ * count_)
    {
        for (size_t i = 0; i < count_; ++i)
            for (size_t j = 0; j <= i; ++j)
            {
                const double left =
                    size * size * gram(i, j) + (i == j ? 1 : 0) - Product(Row(i), Row(j), j);
                if (i == j && !(left > 0))
                    throw std::domain_error("columns have no products like these");
                low_[i * count_ + j] = i == j ? std::sqrt(left) : left / Row(j)[j];
            }
    }

    double LogRoot() const
    {
        double sum = 0;
        for (size_t i = 0; i < count_; ++i)
            sum += std::log(Row(i)[i]);
        return sum;
    }

    // Makes a push what the covariance's inverse makes of it; returns the product of both.
    double Solve(std::span<double> push) const
    {
        for (size_t i = 0; i < count_; ++i)
            push[i] = (push[i] - Product(Row(i), push.data(), i)) / Row(i)[i];
        const double along = Product(push.data(), push.data(), count_);
        for (size_t i = count_; i-- > 0;)
        {
            push[i] /= Row(i)[i];
            for (size_t j = 0; j < i; ++j)
                push[j] -= Row(i)[j] * push[i];
        }
        return along;
    }

private:
    const double *Row(size_t i) const { return low_.data() + i * count_; }

    size_t count_;
    std::vector<double> low_;
};

Array GainsBySize(const std::vector<Matrix> &grams, Vector push, Vector sizes)
{
    const size_t count = grams.size(), of_each = sizes.size();
    size_t first = 0;
    std::vector<double> found(2 * count * of_each), solved;
    for (size_t f = 0; f < count; first += grams[f++].shape(0))
    {
        const size_t width = grams[f].shape(0);
        if (grams[f].shape(1) != width || first + width > push.size())
            throw std::invalid_argument("products must be square, and as many as pushes");
        for (size_t s = 0; s < of_each; ++s)
        {
            const double size = sizes.data()[s];
            const Sized sized(grams[f], size);
            solved.assign(push.data() + first, push.data() + first + width);
            const double along = sized.Solve(solved);
            double *out = found.data() + f * of_each + s;
            out[0] = size * size * along / 2 - sized.LogRoot();
            out[count * of_each] =
                size * size * (along + Product(solved.data(), solved.data(), width));
        }
    }
    return ToNumpy(std::move(found), {2, count, of_each});
}

}  // namespace

void BindProducts(nb::module_ &m)
{
    m.def("products_beside", &ProductsBeside, "columns"_a, "beside"_a, "weight"_a, "edges"_a,
          "(B, P + 1, T) of columns (R, T) with P columns `beside` (R, P), and at last of their "
          "squares with those of a weight (R,), over the rows between two of `edges` (B + 1,).");
    m.def(
        "gains_by_size", &GainsBySize, "grams"_a, "push"_a, "sizes"_a,
        "(2, F, S) gain in log evidence by each of F terms with weights of N(0, size^2), and fall "
        "of the squares, of (K, K) products of its columns and, one after the other, (K,) those "
        "with the data.");
    m.def("products_left", &ProductsLeft, "pieces"_a, "places"_a, "weight"_a, "basis"_a, "along"_a,
          "edges"_a,
          "(N, B, k, k) of sets of columns with each other, over the rows between two of `edges` "
          "(B + 1,). Columns `places` (N, k) of T that stand side by side in pieces (R, t), each "
          "weighted (R,) and less `basis` (P, R) times `along` (P, T).");
}

}  // namespace twin
