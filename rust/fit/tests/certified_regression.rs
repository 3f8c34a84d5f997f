//! Linear regressions with certified results: Statistical Reference Datasets of the National Institute of Standards and Technology.
//!
//! Each is solved to the digits that its condition number leaves, or is said to be ill-conditioned.
#![allow(
    clippy::unreadable_literal,
    clippy::inconsistent_digit_grouping,
    clippy::excessive_precision,
    clippy::expect_used,
    missing_docs
)]

use imufit_fit::normal_equations::{NormalEquations, TRUSTED_CONDITION};
use nalgebra::{DMatrix, DVector};

struct Dataset {
    name: &'static str,
    x: DMatrix<f64>,
    y: DVector<f64>,
    /// Certified estimates and their standard deviations.
    certified: &'static [(f64, f64)],
}

impl Dataset {
    fn equations(&self) -> NormalEquations {
        // Summed in blocks, as evidence is.
        let p = self.x.ncols();
        let mut total = NormalEquations::zeros(p);
        for first in (0..self.x.nrows()).step_by(7) {
            let rows = 7.min(self.x.nrows() - first);
            let (x, y) = (self.x.rows(first, rows), self.y.rows(first, rows));
            let block = NormalEquations {
                gram: x.tr_mul(&x),
                right: x.tr_mul(&y),
                square: y.dot(&y),
                n: rows as f64,
            };
            total.add(&block, 1.0);
        }
        total
    }

    /// Largest error of an estimate and of a standard deviation, relative to the certified ones.
    fn errors(&self) -> (f64, f64) {
        let equations = self.equations();
        let p = self.x.ncols();
        let Some(solved) = equations.solve(&DVector::zeros(p)) else {
            return (f64::INFINITY, f64::INFINITY);
        };
        let residual = &self.y - &self.x * &solved.solution;
        let variance = residual.norm_squared() / (self.x.nrows() - p) as f64;
        let covariance = solved.covariance();
        let (mut estimate, mut deviation) = (0.0_f64, 0.0_f64);
        for (j, (value, sd)) in self.certified.iter().enumerate() {
            estimate = estimate.max((solved.solution[j] / value - 1.0).abs());
            deviation = deviation.max(((variance * covariance[(j, j)]).sqrt() / sd - 1.0).abs());
        }
        (estimate, deviation)
    }
}

fn polynomial(x: &[f64], degree: usize) -> DMatrix<f64> {
    DMatrix::from_fn(x.len(), degree + 1, |i, j| x[i].powf(j as f64))
}

/// Lower difficulty: ozone monitors, a straight line.
fn norris() -> Dataset {
    let x = [
        0.2, 337.4, 118.2, 884.6, 10.1, 226.5, 666.3, 996.3, 448.6, 777.0, 558.2, 0.4, 0.6, 775.5, 666.9, 338.0, 447.5,
        11.6, 556.0, 228.1, 995.8, 887.6, 120.2, 0.3, 0.3, 556.8, 339.1, 887.2, 999.0, 779.0, 11.1, 118.3, 229.2,
        669.1, 448.9, 0.5,
    ];
    let y = [
        0.1, 338.8, 118.1, 888.0, 9.2, 228.1, 668.5, 998.5, 449.1, 778.9, 559.2, 0.3, 0.1, 778.1, 668.8, 339.3, 448.9,
        10.8, 557.7, 228.3, 998.0, 888.8, 119.6, 0.3, 0.6, 557.6, 339.3, 888.0, 998.5, 778.9, 10.2, 117.6, 228.9,
        668.4, 449.2, 0.2,
    ];
    Dataset {
        name: "Norris",
        x: polynomial(&x, 1),
        y: DVector::from_row_slice(&y),
        certified: &[
            (-0.262_323_073_774_029, 0.232_818_234_301_152),
            (1.002_116_818_020_45, 0.429_796_848_199_937e-3),
        ],
    }
}

/// Higher difficulty: seven economic series that nearly depend on each other.
fn longley() -> Dataset {
    let rows = [
        [83.0, 234_289.0, 2356.0, 1590.0, 107_608.0, 1947.0, 60323.0],
        [88.5, 259_426.0, 2325.0, 1456.0, 108_632.0, 1948.0, 61122.0],
        [88.2, 258_054.0, 3682.0, 1616.0, 109_773.0, 1949.0, 60171.0],
        [89.5, 284_599.0, 3351.0, 1650.0, 110_929.0, 1950.0, 61187.0],
        [96.2, 328_975.0, 2099.0, 3099.0, 112_075.0, 1951.0, 63221.0],
        [98.1, 346_999.0, 1932.0, 3594.0, 113_270.0, 1952.0, 63639.0],
        [99.0, 365_385.0, 1870.0, 3547.0, 115_094.0, 1953.0, 64989.0],
        [100.0, 363_112.0, 3578.0, 3350.0, 116_219.0, 1954.0, 63761.0],
        [101.2, 397_469.0, 2904.0, 3048.0, 117_388.0, 1955.0, 66019.0],
        [104.6, 419_180.0, 2822.0, 2857.0, 118_734.0, 1956.0, 67857.0],
        [108.4, 442_769.0, 2936.0, 2798.0, 120_445.0, 1957.0, 68169.0],
        [110.8, 444_546.0, 4681.0, 2637.0, 121_950.0, 1958.0, 66513.0],
        [112.6, 482_704.0, 3813.0, 2552.0, 123_366.0, 1959.0, 68655.0],
        [114.2, 502_601.0, 3931.0, 2514.0, 125_368.0, 1960.0, 69564.0],
        [115.7, 518_173.0, 4806.0, 2572.0, 127_852.0, 1961.0, 69331.0],
        [116.9, 554_894.0, 4007.0, 2827.0, 130_081.0, 1962.0, 70551.0],
    ];
    Dataset {
        name: "Longley",
        x: DMatrix::from_fn(16, 7, |i, j| if j == 0 { 1.0 } else { rows[i][j - 1] }),
        y: DVector::from_fn(16, |i, _| rows[i][6]),
        certified: &[
            (-3_482_258.634_595_82, 890_420.383_607_373),
            (15.061_872_271_373_3, 84.914_925_774_766_9),
            (-0.358_191_792_925_910e-1, 0.334_910_077_722_432e-1),
            (-2.020_229_803_816_83, 0.488_399_681_651_699),
            (-1.033_226_867_173_59, 0.214_274_163_161_675),
            (-0.511_041_056_535_807e-1, 0.226_073_200_069_370),
            (1829.151_464_613_55, 455.478_499_142_212),
        ],
    }
}

/// Higher difficulty: a polynomial of degree ten far from zero.
fn filip() -> Dataset {
    let x = [
        -6.860120914,
        -4.324130045,
        -4.358625055,
        -4.358426747,
        -6.955852379,
        -6.661145254,
        -6.355462942,
        -6.118102026,
        -7.115148017,
        -6.815308569,
        -6.519993057,
        -6.204119983,
        -5.853871964,
        -6.109523091,
        -5.79832982,
        -5.482672118,
        -5.171791386,
        -4.851705903,
        -4.517126416,
        -4.143573228,
        -3.709075441,
        -3.499489089,
        -6.300769497,
        -5.953504836,
        -5.642065153,
        -5.031376979,
        -4.680685696,
        -4.329846955,
        -3.928486195,
        -8.56735134,
        -8.363211311,
        -8.107682739,
        -7.823908741,
        -7.522878745,
        -7.218819279,
        -6.920818754,
        -6.628932138,
        -6.323946875,
        -5.991399828,
        -8.781464495,
        -8.663140179,
        -8.473531488,
        -8.247337057,
        -7.971428747,
        -7.676129393,
        -7.352812702,
        -7.072065318,
        -6.774174009,
        -6.478861916,
        -6.159517513,
        -6.835647144,
        -6.53165267,
        -6.224098421,
        -5.910094889,
        -5.598599459,
        -5.290645224,
        -4.974284616,
        -4.64454848,
        -4.290560426,
        -3.885055584,
        -3.408378962,
        -3.13200249,
        -8.726767166,
        -8.66695597,
        -8.511026475,
        -8.165388579,
        -7.886056648,
        -7.588043762,
        -7.283412422,
        -6.995678626,
        -6.691862621,
        -6.392544977,
        -6.067374056,
        -6.684029655,
        -6.378719832,
        -6.065855188,
        -5.752272167,
        -5.132414673,
        -4.811352704,
        -4.098269308,
        -3.66174277,
        -3.2644011,
    ];
    let y = [
        0.8116, 0.9072, 0.9052, 0.9039, 0.8053, 0.8377, 0.8667, 0.8809, 0.7975, 0.8162, 0.8515, 0.8766, 0.8885, 0.8859,
        0.8959, 0.8913, 0.8959, 0.8971, 0.9021, 0.909, 0.9139, 0.9199, 0.8692, 0.8872, 0.89, 0.891, 0.8977, 0.9035,
        0.9078, 0.7675, 0.7705, 0.7713, 0.7736, 0.7775, 0.7841, 0.7971, 0.8329, 0.8641, 0.8804, 0.7668, 0.7633, 0.7678,
        0.7697, 0.77, 0.7749, 0.7796, 0.7897, 0.8131, 0.8498, 0.8741, 0.8061, 0.846, 0.8751, 0.8856, 0.8919, 0.8934,
        0.894, 0.8957, 0.9047, 0.9129, 0.9209, 0.9219, 0.7739, 0.7681, 0.7665, 0.7703, 0.7702, 0.7761, 0.7809, 0.7961,
        0.8253, 0.8602, 0.8809, 0.8301, 0.8664, 0.8834, 0.8898, 0.8964, 0.8963, 0.9074, 0.9119, 0.9228,
    ];
    Dataset {
        name: "Filip",
        x: polynomial(&x, 10),
        y: DVector::from_row_slice(&y),
        certified: &[
            (-1467.489_614_229_80, 298.084_530_995_537),
            (-2772.179_591_933_42, 559.779_865_474_950),
            (-2316.371_081_608_93, 466.477_572_127_796),
            (-1127.973_940_983_72, 227.204_274_477_751),
            (-354.478_233_703_349, 71.647_866_087_592_7),
            (-75.124_201_737_575_7, 15.289_717_874_740_0),
            (-10.875_318_035_534_3, 2.236_911_598_160_33),
            (-1.062_214_985_889_47, 0.221_624_321_934_227),
            (-0.670_191_154_593_408e-1, 0.142_363_763_154_724e-1),
            (-0.246_781_078_275_479e-2, 0.535_617_408_889_821e-3),
            (-0.402_962_525_080_404e-4, 0.896_632_837_373_868e-5),
        ],
    }
}

/// A wavy column and another that differs from it by `apart` of a second one: condition about 2 / `apart`.
fn nearly_dependent(apart: f64) -> NormalEquations {
    let x = DMatrix::from_fn(400, 2, |i, j| {
        let i = i as f64;
        (0.1 * i).sin() + if j == 0 { 0.0 } else { apart * (0.37 * i).cos() }
    });
    let truth = DVector::from_vec(vec![0.7, -0.3]);
    let y = &x * truth;
    NormalEquations {
        gram: x.tr_mul(&x),
        right: x.tr_mul(&y),
        square: y.dot(&y),
        n: 400.0,
    }
}

#[test]
fn certified_results_come_out_or_the_condition_number_says_why_not() {
    for dataset in [norris(), longley(), filip()] {
        let condition = dataset.equations().condition();
        let (estimate, deviation) = dataset.errors();
        println!(
            "{}: condition {condition:.3e}, errors {estimate:.1e} and {deviation:.1e}",
            dataset.name
        );
        if condition <= TRUSTED_CONDITION {
            // The ridge stays in the covariance.
            assert!(
                estimate < 1e-5 && deviation < 0.02,
                "{}: {estimate:e} {deviation:e}",
                dataset.name
            );
        }
    }
    assert!(norris().equations().condition() < 10.0);
    assert!(norris().errors().0 < 1e-10);
    assert!(longley().equations().condition() < TRUSTED_CONDITION);
    assert!(filip().equations().condition() > TRUSTED_CONDITION);
}

#[test]
fn four_digits_are_right_up_to_the_trusted_condition_number() {
    for apart in [1.0, 1e-1, 1e-2, 1e-3, 1e-4, 4.1e-5] {
        let equations = nearly_dependent(apart);
        assert!(equations.condition() <= TRUSTED_CONDITION, "{}", equations.condition());
        let solved = equations.solve(&DVector::zeros(2)).expect("determined");
        assert!((solved.solution[0] / 0.7 - 1.0).abs() < 1e-4 && (solved.solution[1] / -0.3 - 1.0).abs() < 1e-4);
    }
    assert!(nearly_dependent(1e-5).condition() > TRUSTED_CONDITION);
    assert!(nearly_dependent(0.0).condition().is_infinite());
    assert!((nearly_dependent(1.0).condition() - 2.414).abs() < 0.1);
}
