// SPDX-License-Identifier: Apache-2.0
// Sums of rows of numbers, four at a time.
#ifndef PYTHON_ADD_ROWS_H
#define PYTHON_ADD_ROWS_H

#include <cstddef>
#include <span>

namespace twin
{

// As many values as rows, so far apart.
struct Shares
{
    const double *first;
    size_t count;
    size_t apart = 1;

    double operator[](size_t j) const { return first[j * apart]; }
};

// Adds rows, so many values apart, each times its share, to one row.
inline void AddRows(std::span<double> sum, Shares shares, const double *rows, size_t apart)
{
    size_t j = 0;
    for (; j + 4 <= shares.count; j += 4, rows += 4 * apart)
    {
        const double *second = rows + apart, *third = second + apart, *fourth = third + apart;
        const double a = shares[j], b = shares[j + 1], c = shares[j + 2], d = shares[j + 3];
        for (size_t k = 0; k < sum.size(); ++k)
            sum[k] += a * rows[k] + b * second[k] + c * third[k] + d * fourth[k];
    }
    for (; j < shares.count; ++j, rows += apart)
        for (size_t k = 0; k < sum.size(); ++k)
            sum[k] += shares[j] * rows[k];
}

}  // namespace twin

#endif
