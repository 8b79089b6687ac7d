// SPDX-License-Identifier: Apache-2.0
// twin/plant/world_body.cpp. Truth: plane geometry.
#include "plant/world_body.h"

#include <gtest/gtest.h>

namespace twin
{
namespace
{

using Eigen::Vector2d;

const Capsule kDisc{{1, 0}, {1, 0}, 0.1}, kWall{{1, -1}, {1, 1}, 0.02};

TEST(Capsule, NearestPointIsTheFootOfThePerpendicularOrAnEnd)
{
    EXPECT_EQ(NearestPoint(kDisc, {5, 3}), Vector2d(1, 0));
    EXPECT_TRUE(NearestPoint(kWall, {0.3, 0.4}).isApprox(Vector2d(1, 0.4)));
    EXPECT_TRUE(NearestPoint(kWall, {2, 7}).isApprox(Vector2d(1, 1)));
}

TEST(Capsule, IsCrossedByWaysThatPassNearerThanItsRadius)
{
    EXPECT_TRUE(Crosses(kDisc, {0, 0.0999}, {2, 0.0999}));
    EXPECT_FALSE(Crosses(kDisc, {0, 0.1001}, {2, 0.1001}));
    EXPECT_FALSE(Crosses(kDisc, {0, 0}, {0.8999, 0}));  // ends before it
    EXPECT_TRUE(Crosses(kWall, {0, 0.9}, {2, 0.9}));
    EXPECT_TRUE(Crosses(kWall, {0, 1.0199}, {2, 1.0199}));
    EXPECT_FALSE(Crosses(kWall, {0, 1.0201}, {2, 1.0201}));
}

// A square of 1 m sides at 0.5 m/s takes 8 s.
TEST(WorldBody, GoesRoundItsPathAtItsSpeed)
{
    const WorldBody evader{"", kDisc, 0.2, "", true, {{2, 0}, {2, 1}, {1, 1}}, 0.5};
    EXPECT_TRUE(evader.At(3).from_m.isApprox(Vector2d(2, 0.5)));
    EXPECT_TRUE(evader.At(7).from_m.isApprox(Vector2d(1, 0.5)));
    EXPECT_TRUE(evader.At(8 + 1).from_m.isApprox(Vector2d(1.5, 0)));
    const WorldBody gate{"", kWall, 0.2, "", true, {{2, -1}}, 0.5};
    EXPECT_TRUE(gate.At(1).to_m.isApprox(Vector2d(1.5, 1)));
    const WorldBody still{"", kDisc, 0.2, ""};
    EXPECT_EQ(still.At(100).from_m, kDisc.from_m);
}

}  // namespace
}  // namespace twin
