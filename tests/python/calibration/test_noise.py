# SPDX-License-Identifier: Apache-2.0
"""Noise of one-step errors: spectrum, whitening, and estimates of noise that was put in."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import freqz, lfilter
from scipy.stats import chi2

from twinmill.data.track import command_at
from twinmill.fitting.compare import compare_robot
from twinmill.fitting.opening import open_measurements
from twinmill.predict.flexible import unexplained
from twinmill.predict.modelled_log import ModelledLog
from twinmill.predict.noise import TRANSIENT, ChannelNoise, Noise, fit_noise
from twinmill.predict.residual import StepGrid
from twinmill.predict.whiteness import memory, p_value

TRUTHS = [
    (ChannelNoise(3e-4, 3e-3, 0.15), ChannelNoise(1.75e-3, 0.03, 0.15), 1 / 120),
    (ChannelNoise(1e-4, 7e-3, 0.3), ChannelNoise(5e-4, 0.03, 0.05), 1 / 100),
    (ChannelNoise(1e-3, 2e-3, 0.15), ChannelNoise(5e-3, 0.02, 0.1), 1 / 60),
]


def even_grid(count, period_s):
    index = np.arange(count)
    return StepGrid(index, index - 1, np.ones(count), np.array([0]), index * period_s, period_s)


def drawn(channel, count, period_s, random):
    """One-step errors as the module's head defines them, by scipy's filter."""
    phi = np.exp(-period_s / channel.memory_s)
    settle = 2000
    drive = lfilter([np.sqrt(1 - phi**2)], [1, -phi], random.normal(size=count + settle))[settle:]
    return period_s * channel.drive * drive + channel.sensor * np.diff(
        random.normal(size=count + 1)
    )


@pytest.mark.parametrize("channel, period_s", [(c, t[2]) for t in TRUTHS for c in t[:2]])
def test_spectrum_is_that_of_the_arma_form_that_whitens(channel, period_s):
    numerator, denominator, scale = channel.whitening(period_s)
    frequency_Hz = np.linspace(0.1, 0.5 / period_s, 200)
    # Whitening divides by the moving average and multiplies by the pole: the inverse colours.
    _, colour = freqz(denominator, numerator, worN=frequency_Hz, fs=1 / period_s)
    assert channel.spectrum(frequency_Hz, period_s) == pytest.approx(
        scale**2 * np.abs(colour) ** 2, rel=1e-6
    )
    assert np.all(np.abs(np.roots(denominator)) < 1)


@pytest.mark.parametrize("channel, period_s", [(t[0], t[2]) for t in TRUTHS])
def test_mean_of_the_spectrum_is_the_variance(channel, period_s):
    # Wiener and Khinchin: 2 sensor^2 + (dt drive)^2, by the independence of the parts.
    frequency_Hz = np.fft.fftfreq(2**16, period_s)
    variance = 2 * channel.sensor**2 + (period_s * channel.drive) ** 2
    assert channel.spectrum(frequency_Hz, period_s).mean() == pytest.approx(variance, rel=1e-6)


@pytest.mark.parametrize("position, heading, period_s", TRUTHS)
def test_whitened_errors_have_unit_variance_and_no_memory(position, heading, period_s):
    count, lags = 60_000, 40
    random = np.random.default_rng(5)
    errors = np.column_stack(
        [drawn(c, count, period_s, random) for c in (position, position, heading)]
    )
    white = Noise(position, heading).whiten(errors, even_grid(count, period_s))
    assert np.all(white[:TRANSIENT] == 0)
    for channel in white[10 * TRANSIENT :].T:
        n = len(channel)
        # Variance of a mean of squares is 2/n; Ljung and Box 1978: chi2 of that many lags.
        assert channel.var() == pytest.approx(1, abs=4 * np.sqrt(2 / n))
        rho = [np.mean(channel[k:] * channel[:-k]) / channel.var() for k in range(1, lags + 1)]
        box = n * (n + 2) * np.sum(np.square(rho) / (n - np.arange(1, lags + 1)))
        assert box < chi2.ppf(0.9999, lags)


def test_whitening_starts_anew_after_a_break():
    channel = TRUTHS[0][0]
    random = np.random.default_rng(6)
    parts = [drawn(channel, 500, 1 / 120, random) for _ in range(2)]
    index = np.arange(1000)
    grid = StepGrid(index, index - 1, np.ones(1000), np.array([0, 500]), index / 120, 1 / 120)
    noise = Noise(channel, channel)
    white = noise.whiten(np.tile(np.concatenate(parts)[:, None], 3), grid)
    alone = noise.whiten(np.tile(parts[1][:, None], 3), even_grid(500, 1 / 120))
    assert white[500:] == pytest.approx(alone, abs=0)


@pytest.mark.parametrize("position, heading, period_s", TRUTHS)
def test_fit_recovers_the_noise_without_bias(position, heading, period_s):
    """Mean of many logs within three of its standard errors, and 3 % for what is of second order.

    Drive and memory trade against each other in a short log: what long horizons see is
    drive^2 memory, the power at zero frequency, so that is asked for.
    """
    count, logs = round(150 / period_s), 16
    found = []
    for seed in range(logs):
        random = np.random.default_rng(seed)
        errors = np.column_stack(
            [drawn(c, count, period_s, random) for c in (position, position, heading)]
        )
        noise = fit_noise([errors], np.ones(count, bool), even_grid(count, period_s))
        found.append(
            [
                (
                    fitted.sensor / true.sensor,
                    fitted.drive / true.drive,
                    fitted.drive**2 * fitted.memory_s / true.drive**2 / true.memory_s,
                )
                for fitted, true in ((noise.position, position), (noise.heading, heading))
            ]
        )
    mean, scatter = np.mean(found, 0), np.std(found, 0, ddof=1)
    assert np.all(np.abs(mean - 1) < 3 * scatter / np.sqrt(logs) + 0.03), mean
    assert np.all(scatter[:, 0] < 0.02)


def test_fit_of_sensor_noise_alone_finds_no_drive_noise_that_matters():
    period_s, sensor = 1 / 120, 3e-4
    errors = sensor * np.diff(np.random.default_rng(8).normal(size=(18_001, 3)), axis=0)
    noise = fit_noise([errors], np.ones(18_000, bool), even_grid(18_000, period_s))
    assert noise.position.sensor == pytest.approx(sensor, rel=0.02)
    # Over half a second the fitted drive moves the robot by less than half the sensor's noise.
    position = noise.position
    walk_m = position.drive * np.sqrt(2 * position.memory_s * 0.5)
    assert walk_m < sensor / 2


def test_noise_is_not_taken_from_stretches_at_rest():
    position, heading, period_s = TRUTHS[0]
    random = np.random.default_rng(9)
    count = 36_000
    errors = np.column_stack(
        [drawn(c, count, period_s, random) for c in (position, position, heading)]
    )
    moving = np.arange(count) // 3000 % 2 == 0
    errors[~moving] = 1e-6 * random.normal(size=(np.count_nonzero(~moving), 3))
    noise = fit_noise([errors], moving, even_grid(count, period_s))
    assert noise.position.sensor == pytest.approx(position.sensor, rel=0.05)
    assert noise.heading.drive == pytest.approx(heading.drive, rel=0.25)


@pytest.fixture(scope="module", params=[{}, {"coast_mps2": 0.7}], ids=["lag", "coasting"])
def driven_log(request, tanh_robot, measure):
    """A robot of another form with known noise."""
    robot = tanh_robot(**request.param)
    return robot, measure(robot, 3, 90.0)


def test_unexplained_is_the_noise_whatever_the_robot_does(driven_log):
    """A curve, a lag and coasting unknown to the regression leave the noise and little more.

    Sensors to 5 %. Drive, as its power at zero frequency which long horizons see: 20 % is the
    scatter of one log of 90 s, and its own regression leaves as much again of the physics.
    """
    robot, measurement = driven_log
    grid = StepGrid.of(measurement)
    track = measurement.track
    moving = np.any(command_at(grid.t_s, track.command_t_s, track.command) != 0, axis=1)
    within, across = unexplained(measurement, grid, 0.0)
    noise = fit_noise([within, across], moving, grid)
    assert noise.position.sensor == pytest.approx(robot.sensor_m, rel=0.05)
    assert noise.heading.sensor == pytest.approx(robot.sensor_rad, rel=0.05)
    for fitted, drive in ((noise.position, robot.drive_mps), (noise.heading, robot.drive_radps)):
        slow = fitted.drive**2 * fitted.memory_s / (drive**2 * robot.memory_s)
        assert 0.6 < slow < 1.6


def test_overfitting_cancels_where_the_truth_is_only_noise(tanh_robot, measure):
    """Errors that are white by making: what a fit takes away, its held-out errors give back."""
    measurement = measure(tanh_robot(drive_mps=0, drive_radps=0, sensor_m=0, sensor_rad=0), 3, 60.0)
    grid = StepGrid.of(measurement)
    track = measurement.track
    white = 1e-3 * np.random.default_rng(1).normal(size=track.pose.shape)
    noisy = replace(measurement, track=replace(track, pose=np.cumsum(white, axis=0)))
    # By medians, as the noise is taken: few steps, unlike all others, are predicted from nothing.
    own = np.median(white[grid.source] ** 2)
    within, across = (np.median(e**2) / own for e in unexplained(noisy, grid, 0.0))
    assert within < 1 < across
    assert (within + across) / 2 == pytest.approx(1, abs=0.06)


def test_noise_of_a_scene_does_not_hang_on_the_model(driven_log, model_file):
    _, measurement = driven_log
    guesses = [
        model_file(),
        model_file(("[0, 0.1, 0.2, 0.3, 0.4]", "[0, 0.2, 0.3, 0.4, 0.5]"), ("0.05", "0.2")),
    ]
    first, second = (
        ModelledLog.on_clock(measurement, g.model, clock_free=False).noise for g in guesses
    )
    assert first == second


def test_p_values_are_uniform_where_draws_are_of_the_noise_and_a_memory_has_a_small_one():
    """Level of the test by definition: 10 % of logs are below 0.1, give or take 3 errors."""
    random, logs, keep = np.random.default_rng(3), 300, 0.4  # of each error in the next

    def drawn(count, kept):
        new = random.normal(size=(count, 400, 5, 3))
        return [memory(e) for e in lfilter([1], [1, -kept], new, axis=1)]

    found = [p_value(m, np.array(drawn(64, keep))) for m in drawn(logs, keep)]
    assert np.mean(np.array(found) < 0.1) == pytest.approx(0.1, abs=3 * np.sqrt(0.09 / logs))
    assert p_value(drawn(1, keep + 0.2)[0], np.array(drawn(64, keep))) == 1 / 65


def test_errors_of_the_right_model_are_white_and_those_without_its_lag_are_not(
    tanh_robot, measure, true_model
):
    (own,) = open_measurements([measure(tanh_robot(), 3, 90.0)], true_model)
    quick = own.model.copy()
    quick.set("base.motor_lag_s", 0.0)
    right, wrong = compare_robot(own), compare_robot(own.with_model(quick))
    assert right.whiteness > 0.01
    assert wrong.whiteness == 1 / 65
