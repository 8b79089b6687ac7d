// SPDX-License-Identifier: Apache-2.0
// Arrays to and from numpy.
#ifndef PYTHON_ARRAYS_H
#define PYTHON_ARRAYS_H

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <memory>
#include <span>
#include <vector>

namespace twin
{

namespace nb = nanobind;

using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Matrix = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Cube = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Indices = nb::ndarray<const int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using IndexMatrix = nb::ndarray<const int64_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Array = nb::ndarray<nb::numpy, double>;

template <class T>
auto Span(const T &array)
{
    return std::span(array.data(), array.size());
}

// Hands a vector's memory to numpy.
template <class T>
nb::ndarray<nb::numpy, T> ToNumpy(std::vector<T> &&values, std::initializer_list<size_t> shape)
{
    auto *owned = new std::vector<T>(std::move(values));
    nb::capsule owner(owned, [](void *p) noexcept { delete static_cast<std::vector<T> *>(p); });
    return {owned->data(), shape, owner};
}

// The same of an array that was written as a whole: a vector would be cleared before.
inline Array ToNumpy(std::unique_ptr<double[]> &&values, std::initializer_list<size_t> shape)
{
    double *owned = values.release();
    nb::capsule owner(owned, [](void *p) noexcept { delete[] static_cast<double *>(p); });
    return Array(owned, shape, owner);
}

// Adds the container of logs.
void BindEvents(nb::module_ &m);

// Adds sums and filters over time.
void BindSeries(nb::module_ &m);

// Adds gains in evidence by products of columns.
void BindProducts(nb::module_ &m);

// Adds what the module knows of swarms.
void BindSwarms(nb::module_ &m);

// Adds the firmware's look at pictures.
void BindThreshold(nb::module_ &m);

}  // namespace twin

#endif
