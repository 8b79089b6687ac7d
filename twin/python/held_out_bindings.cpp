// SPDX-License-Identifier: Apache-2.0
// Ridge regressions that are judged on blocks of rows which they were not fitted to.
#include <algorithm>
#include <memory>

#include "add_rows.h"
#include "arrays.h"

using namespace nanobind::literals;

namespace twin
{
namespace
{

// A definite matrix (k, k), and behind it right sides (k, R), which become the solutions.
class Equations
{
public:
    Equations(size_t count, size_t sides)
        : count_(count), width_(count + sides), rows_(count * width_), shares_(count)
    {
    }

    double *Row(size_t i) { return rows_.data() + i * width_; }
    std::span<double> Sides(size_t i) { return {Row(i) + count_, width_ - count_}; }

    // Adds to a row those sides, each times its share.
    void AddSides(std::span<double> sum, Shares shares, size_t first = 0)
    {
        AddRows(sum, shares, Row(first) + count_, width_);
    }

    void Solve()
    {
        for (size_t i = 1; i < count_; ++i)
        {
            for (size_t j = 0; j < i; ++j)
                shares_[j] = -Row(j)[i] / Row(j)[j];
            AddRows({Row(i) + i, width_ - i}, {shares_.data(), i}, Row(0) + i, width_);
        }
        for (size_t i = count_; i-- > 0;)
        {
            for (size_t j = i + 1; j < count_; ++j)
                shares_[j] = -Row(i)[j];
            if (i + 1 < count_)
                AddSides(Sides(i), {shares_.data() + i + 1, count_ - i - 1}, i + 1);
            for (double &side : Sides(i))
                side /= Row(i)[i];
        }
    }

private:
    size_t count_, width_;
    std::vector<double> rows_, shares_;
};

// Signs (F, B) of blocks, every n-th of which is of one fold: those of a fold side by side.
struct Signs
{
    size_t folds, per, count;
    std::vector<double> rows;

    Signs(const std::vector<double> &signs, size_t blocks, size_t folds_of_all)
        : folds(folds_of_all),
          per((blocks + folds - 1) / folds),
          count(signs.size() / blocks),
          rows(folds * per * count)
    {
        for (size_t b = 0; b < blocks; ++b)
            for (size_t s = 0; s < count; ++s)
                rows[Place(b) * count + s] = signs[s * blocks + b];
    }

    size_t Place(size_t block) const { return block % folds * per + block / folds; }
};

// Gains under random signs of B blocks, a quadratic form of these: of each sign by itself, or of
// the form's parts (B, B), of which there are less where columns are many and blocks few.
class Gains
{
public:
    Gains(size_t blocks, size_t columns, Matrix signs, size_t folds)
        : blocks_(blocks),
          signs_(signs.data(), signs.data() + signs.size()),
          by_block_(signs.shape(0) > blocks && 2 * folds * columns * columns > blocks * blocks),
          parts_(by_block_ ? blocks * blocks : 0),
          of_all_(signs_, blocks, 1)
    {
    }

    // Those that the parts are made under.
    Signs Asked(size_t folds) const
    {
        if (!by_block_)
            return {signs_, blocks_, folds};
        std::vector<double> each(blocks_ * blocks_);
        for (size_t b = 0; b < blocks_; ++b)
            each[b * (blocks_ + 1)] = 1;
        return {each, blocks_, folds};
    }

    void Clear(double *gains)
    {
        std::fill_n(gains, 1 + of_all_.count, 0.0);
        std::ranges::fill(parts_, 0.0);
    }

    // Adds products of values, the first of all blocks and then of each of what was asked.
    void Add(std::span<const double> left, std::span<const double> right, double *gains)
    {
        for (size_t s = 0; s < (by_block_ ? 1 : left.size()); ++s)
            gains[s] += left[s] * right[s];
        for (size_t b = 0; by_block_ && b < blocks_; ++b)
            AddRows(Part(b), {left.data() + 1 + b, 1}, right.data() + 1, 0);
    }

    void AddParts(double *gains)
    {
        std::vector<double> some(of_all_.count);
        for (size_t b = 0; by_block_ && b < blocks_; ++b)
        {
            std::ranges::fill(some, 0.0);
            AddRows(some, {Part(b).data(), blocks_}, of_all_.rows.data(), some.size());
            for (size_t s = 0; s < some.size(); ++s)
                gains[1 + s] += of_all_.rows[b * some.size() + s] * some[s];
        }
    }

private:
    std::span<double> Part(size_t b) { return {parts_.data() + b * blocks_, blocks_}; }

    size_t blocks_;
    std::vector<double> signs_;
    bool by_block_;
    std::vector<double> parts_;
    Signs of_all_;
};

// What some columns lower the cost by on each fold when they are fitted to the others.
class Regression
{
public:
    Regression(size_t count, const Signs &signs)
        : count_(count),
          sides_(1 + signs.count),
          signs_(signs),
          whole_(count * count),
          total_(count * sides_),
          scatter_(count * signs.folds * signs.per),
          judged_(signs.folds * count * sides_),
          some_(sides_),
          one_(count, 1),
          all_(count, sides_)
    {
    }

    // Of columns with moments (B, count), products (B, count, count) and those (folds, ...).
    void Judge(const std::vector<double> &moments, const double *blocks, const double *folds,
               double ridge, Gains &form, double *gains)
    {
        Sum(moments, folds, ridge);
        if (signs_.count)
            Flip(moments, blocks);
        std::ranges::fill(total_, 0.0);
        for (size_t f = 0; f < signs_.folds; ++f)
            for (size_t k = 0; k < total_.size(); ++k)
                total_[k] += judged_[f * total_.size() + k];
        form.Clear(gains);
        for (size_t f = 0; f < signs_.folds; ++f)
            AddGains(folds + f * whole_.size(), judged_.data() + f * total_.size(), form, gains);
        form.AddParts(gains);
    }

private:
    void Sum(const std::vector<double> &moments, const double *folds, double ridge)
    {
        std::ranges::fill(whole_, 0.0);
        for (size_t f = 0; f < signs_.folds; ++f)
            for (size_t k = 0; k < whole_.size(); ++k)
                whole_[k] += folds[f * whole_.size() + k];
        for (size_t i = 0; i < count_; ++i)
            whole_[i * (count_ + 1)] += ridge;
        std::ranges::fill(judged_, 0.0);
        for (size_t b = 0; b < moments.size() / count_; ++b)
            for (size_t i = 0; i < count_; ++i)
                judged_[(b % signs_.folds * count_ + i) * sides_] += moments[b * count_ + i];
    }

    // By chance: signs of what each block scatters about a fit to all others.
    void Flip(const std::vector<double> &moments, const double *blocks)
    {
        std::vector<double> sum(count_);
        for (size_t k = 0; k < moments.size(); ++k)
            sum[k % count_] += moments[k];
        const size_t apart = signs_.folds * signs_.per;
        for (size_t b = 0; b < moments.size() / count_; ++b)
        {
            const double *moment = moments.data() + b * count_, *gram = blocks + b * whole_.size();
            for (size_t i = 0; i < count_; ++i)
            {
                for (size_t j = i; j < count_; ++j)
                    one_.Row(i)[j] = whole_[i * count_ + j] - gram[i * count_ + j];
                one_.Sides(i)[0] = sum[i] - moment[i];
            }
            one_.Solve();
            for (size_t i = 0; i < count_; ++i)
            {
                double told = 0;
                one_.AddSides({&told, 1}, {gram + i * count_, count_});
                scatter_[i * apart + signs_.Place(b)] = moment[i] - told;
            }
        }
        for (size_t f = 0; f < signs_.folds; ++f)
            for (size_t i = 0; i < count_; ++i)
                AddRows({judged_.data() + (f * count_ + i) * sides_ + 1, signs_.count},
                        {scatter_.data() + i * apart + f * signs_.per, signs_.per},
                        signs_.rows.data() + f * signs_.per * signs_.count, signs_.count);
    }

    void AddGains(const double *gram, const double *judged, Gains &form, double *gains)
    {
        for (size_t i = 0; i < count_; ++i)
        {
            for (size_t j = i; j < count_; ++j)
                all_.Row(i)[j] = whole_[i * count_ + j] - gram[i * count_ + j];
            for (size_t s = 0; s < sides_; ++s)
                all_.Sides(i)[s] = total_[i * sides_ + s] - judged[i * sides_ + s];
        }
        all_.Solve();
        for (size_t i = 0; i < count_; ++i)
        {
            std::ranges::fill(some_, 0.0);
            all_.AddSides(some_, {gram + i * count_, count_});
            for (size_t s = 0; s < sides_; ++s)
                some_[s] = 2 * judged[i * sides_ + s] - some_[s];
            form.Add(all_.Sides(i), some_, gains);
        }
    }

    size_t count_, sides_;
    const Signs &signs_;
    std::vector<double> whole_, total_, scatter_, judged_, some_;
    Equations one_, all_;
};

Array HeldOut(Matrix moments, IndexMatrix places, Cubes blocks, Cubes folds, Matrix signs,
              double ridge)
{
    const size_t tests = places.shape(0), count = places.shape(1), columns = moments.shape(1);
    const size_t seen = signs.shape(0) ? moments.shape(0) : 0;
    for (const auto &[cubes, of_each] : {std::pair(blocks, seen), {folds, folds.shape(1)}})
        if (cubes.shape(0) != tests || cubes.shape(1) < of_each || cubes.shape(2) != count ||
            cubes.shape(3) != count)
            throw std::invalid_argument(
                "there must be products of each test's columns, of each block and fold");
    if (signs.shape(1) != moments.shape(0))
        throw std::invalid_argument("there must be a sign of each block");
    Gains form(moments.shape(0), count, signs, folds.shape(1));
    const Signs asked = form.Asked(folds.shape(1));
    Regression regression(count, asked);
    std::vector<double> own(moments.shape(0) * count);
    const size_t sides = 1 + signs.shape(0), square = count * count;
    auto gains = std::make_unique_for_overwrite<double[]>(tests * sides);
    for (size_t n = 0; n < tests; ++n)
    {
        for (size_t k = 0; k < own.size(); ++k)
        {
            const auto place = static_cast<size_t>(places.data()[n * count + k % count]);
            if (place >= columns)
                throw std::invalid_argument("places must be of columns with moments");
            own[k] = moments.data()[k / count * columns + place];
        }
        regression.Judge(own, blocks.data() + n * blocks.shape(1) * square,
                         folds.data() + n * folds.shape(1) * square, ridge, form,
                         gains.get() + n * sides);
    }
    return ToNumpy(std::move(gains), {tests, sides});
}

}  // namespace

void BindHeldOut(nb::module_ &m)
{
    m.def("held_out", &HeldOut, "moments"_a, "places"_a, "blocks"_a, "folds"_a, "signs"_a,
          "ridge"_a,
          "(N, 1 + F) fall of the squared error by each of N sets of columns, `places` (N, k) of "
          "`moments` (B, T), on folds that they were not fitted to, and by chance: under each of "
          "`signs` (F, B) of what a block scatters about a fit to all others. Every n-th of B "
          "blocks is of one of n folds; `blocks` (N, B, k, k) and `folds` (N, n, k, k) are "
          "products of the columns. Without signs no blocks are asked for.");
}

}  // namespace twin
