// SPDX-License-Identifier: Apache-2.0
// The catalogue: every effect, in alphabetical order.
#include "effects/effect.h"

namespace twin
{

extern const EffectSpec kBatterySag, kCarpetGrain, kClockOffset, kClockRate, kCoasting, kCollision,
    kCoulombFriction, kDeadZone, kEquation, kFalseDetection, kFloorPatch, kFloorTilt, kGainSlope,
    kHeadingBias, kHeatGain, kInputDelay, kLagByDuty, kLateralSlip, kMarkerOffset, kMassOffset,
    kMissedDetection, kMotorLag, kOcclusion, kReversalDeadTime, kReverseAsymmetry, kSensorDelay,
    kSlewLimit, kSpeedCurve, kSpeedSlip, kStrafeLoss, kTurnAsymmetry, kViewAngle, kViewPan,
    kViewRange, kVote, kWheelEccentricity, kWheelGain, kYawLever;

static const EffectSpec *const kCatalogue[] = {
    &kBatterySag,        &kCarpetGrain,     &kClockOffset, &kClockRate,        &kCoasting,
    &kCollision,         &kCoulombFriction, &kDeadZone,    &kEquation,         &kFalseDetection,
    &kFloorPatch,        &kFloorTilt,       &kGainSlope,   &kHeadingBias,      &kHeatGain,
    &kInputDelay,        &kLagByDuty,       &kLateralSlip, &kMarkerOffset,     &kMassOffset,
    &kMissedDetection,   &kMotorLag,        &kOcclusion,   &kReversalDeadTime, &kReverseAsymmetry,
    &kSensorDelay,       &kSlewLimit,       &kSpeedCurve,  &kSpeedSlip,        &kStrafeLoss,
    &kTurnAsymmetry,     &kViewAngle,       &kViewPan,     &kViewRange,        &kVote,
    &kWheelEccentricity, &kWheelGain,       &kYawLever,
};

std::span<const EffectSpec *const> Catalogue()
{
    return kCatalogue;
}

const EffectSpec *FindEffect(std::string_view name)
{
    for (const EffectSpec *spec : kCatalogue)
        if (name == spec->card.name)
            return spec;
    return nullptr;
}

}  // namespace twin
