// SPDX-License-Identifier: Apache-2.0
// The firmware's own look at one picture, for Python: which pixels, and how large a blob.
#include <nanobind/stl/array.h>

#include <array>
#include <memory>
#include <stdexcept>
#include <vector>

#include "arrays.h"
#include "fw/blob.h"
#include "fw/threshold.h"

using namespace nanobind::literals;

namespace twin
{
namespace
{

// (H, 2 W) bytes of YUYV.
using Yuyv = nb::ndarray<const uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Box = std::array<uint8_t, 6>;
using NewMask = nb::ndarray<nb::numpy, bool, nb::ndim<2>>;
using Mask = nb::ndarray<const bool, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

fw_color_box ToBox(const Box &b)
{
    for (size_t i = 0; i < b.size(); i += 2)
        if (b[i] > b[i + 1])
            throw std::invalid_argument("box: each minimum must be at most its maximum");
    return {b[0], b[1], b[2], b[3], b[4], b[5]};
}

Box GreenBox()
{
    const fw_color_box box = fw_color_box_green();
    return {box.y_min, box.y_max, box.u_min, box.u_max, box.v_min, box.v_max};
}

void CheckSize(size_t height, size_t width)
{
    if (width % 2 != 0 || width == 0 || width > FW_MAX_WIDTH_PX || height > FW_MAX_HEIGHT_PX)
        throw std::invalid_argument("pictures must be of an even width, at most " +
                                    std::to_string(FW_MAX_WIDTH_PX) + " x " +
                                    std::to_string(FW_MAX_HEIGHT_PX) + " pixels");
}

NewMask Inside(Yuyv picture, const Box &box)
{
    const size_t height = picture.shape(0), width = picture.shape(1) / 2;
    CheckSize(height, picture.shape(1) % 2 == 0 ? width : 1);
    const fw_color_box limits = ToBox(box);
    const fw_threshold threshold = fw_threshold_make(&limits);
    auto *pixels = new bool[height * width];
    nb::capsule owner(pixels, [](void *p) noexcept { delete[] static_cast<bool *>(p); });
    std::array<uint32_t, FW_MASK_WORDS> mask{};
    for (size_t row = 0; row < height; ++row)
    {
        fw_threshold_row(&threshold, picture.data() + row * 2 * width, static_cast<int>(width),
                         mask.data());
        for (size_t x = 0; x < width; ++x)
            pixels[row * width + x] = mask[x / FW_MASK_WORD_PX] >> x % FW_MASK_WORD_PX & 1;
    }
    return NewMask(pixels, {height, width}, owner);
}

int LargestBlob(Mask pixels)
{
    const size_t height = pixels.shape(0), width = pixels.shape(1);
    CheckSize(height, width);
    const auto blob = std::make_unique<fw_blob>();
    fw_blob_begin(blob.get());
    for (size_t row = 0; row < height; ++row)
    {
        std::array<uint32_t, FW_MASK_WORDS> mask{};
        for (size_t x = 0; x < width; ++x)
            if (pixels(row, x))
                mask[x / FW_MASK_WORD_PX] |= uint32_t{1} << x % FW_MASK_WORD_PX;
        fw_blob_add_row(blob.get(), mask.data(), static_cast<int>(width));
    }
    return blob->largest_px;
}

}  // namespace

void BindThreshold(nb::module_ &m)
{
    m.def("green_box", &GreenBox,
          "The firmware's default y_min, y_max, u_min, u_max, v_min, v_max.");
    m.def("inside", &Inside, "picture"_a, "box"_a,
          "(H, W) pixels of (H, 2 W) bytes of YUYV inside the box, as the robot finds them.");
    m.def("largest_blob_px", &LargestBlob, "pixels"_a,
          "Pixels of the largest connected blob of (H, W), as the robot counts them.");
}

}  // namespace twin
