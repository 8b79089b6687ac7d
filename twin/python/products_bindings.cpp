// SPDX-License-Identifier: Apache-2.0
// Gains in evidence by the products of columns.
#include <nanobind/stl/vector.h>

#include <array>
#include <cmath>

#include "arrays.h"

using namespace nanobind::literals;

namespace twin
{
namespace
{

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
    m.def(
        "gains_by_size", &GainsBySize, "grams"_a, "push"_a, "sizes"_a,
        "(2, F, S) gain in log evidence by each of F terms with weights of N(0, size^2), and fall "
        "of the squares, of (K, K) products of its columns and, one after the other, (K,) those "
        "with the data.");
}

}  // namespace twin
