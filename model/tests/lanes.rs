//! Numbers with lanes: as good as plain ones, and the same in vectors of any width.

#![allow(clippy::unwrap_used)]

use mtj_model::{
    arm::{
        Arm,
        planar::{Configuration, PlanarArm, RigidLink},
    },
    lanes::{Lanes, Width, Work},
    lift,
    lift::Lift,
    scalar::Scalar,
};
use nalgebra::{SVector, Vector2};

/// Some function of each of many numbers.
struct Each<'a, F>(&'a [f64], F);

/// A function of one number.
trait Function {
    fn of<T: Lanes>(&self, x: T) -> T;
}

impl<F: Function> Work for Each<'_, F> {
    type Output = Vec<f64>;
    fn run<T: Lanes>(self) -> Vec<f64> {
        let mut results = Vec::new();
        for chunk in self.0.chunks(T::COUNT) {
            let mut x = T::zero();
            for (lane, number) in chunk.iter().enumerate() {
                x.set(lane, *number);
            }
            let result = self.1.of(x);
            results.extend((0..chunk.len()).map(|lane| result.get(lane)));
        }
        results
    }
}

struct Sine;
struct Cosine;
struct Exponential;
struct Ceiling;
struct Acceleration;

impl Function for Sine {
    fn of<T: Lanes>(&self, x: T) -> T {
        x.sin_cos().0
    }
}

impl Function for Cosine {
    fn of<T: Lanes>(&self, x: T) -> T {
        x.sin_cos().1
    }
}

impl Function for Exponential {
    fn of<T: Lanes>(&self, x: T) -> T {
        x.exp()
    }
}

impl Function for Ceiling {
    fn of<T: Lanes>(&self, x: T) -> T {
        x.ceil()
    }
}

/// Of an arm of three links.
impl Function for Acceleration {
    fn of<T: Lanes>(&self, x: T) -> T {
        let c = T::constant;
        let link = RigidLink { length: c(0.7), mass: c(3.0), center: c(0.3), inertia: c(0.2) };
        let arm = PlanarArm::new(&[link; 3], Vector2::new(T::zero(), c(-9.81)));
        let q = SVector::<T, 3>::new(x, x * c(0.3), -x);
        let torque = SVector::<T, 3>::new(c(4.0), x, c(-1.0));
        arm.acceleration(&Configuration::new(&q, &(q * c(0.5))), &torque)[1]
    }
}

fn numbers(range: f64) -> Vec<f64> {
    (-20_000..=20_000).map(|i| f64::from(i) * (range / 20_000.0) + 1e-9).collect()
}

/// The largest error in units of `scale` at each number.
fn worst(function: impl Function, range: f64, exact: fn(f64) -> f64, scale: fn(f64) -> f64) -> f64 {
    let numbers = numbers(range);
    let results = Width::widest().run(Each(&numbers, function));
    let error = |(x, y): (&f64, &f64)| (y - exact(*x)).abs() / scale(*x);
    numbers.iter().zip(&results).map(error).fold(0.0, f64::max)
}

#[test]
fn sines_cosines_and_exponentials_are_good_to_an_ulp_or_two() {
    let one = |_: f64| f64::EPSILON;
    for range in [0.8, 10.0, 1e4] {
        assert!(worst(Sine, range, f64::sin, one) < 1.0);
        assert!(worst(Cosine, range, f64::cos, one) < 1.0);
    }
    let relative = |x: f64| f64::EPSILON * x.exp();
    assert!(worst(Exponential, 700.0, f64::exp, relative) < 2.0);
}

#[test]
fn the_exponential_of_each_is_that_of_one() {
    for x in numbers(700.0) {
        let powers = f64::exp_each(&SVector::from([x, -x, 0.5 * x]));
        for (power, x) in powers.iter().zip([x, -x, 0.5 * x]) {
            assert!((power / x.exp() - 1.0).abs() < 2.0 * f64::EPSILON, "e^{x}: {power}");
        }
    }
}

#[test]
fn exponentials_end_where_doubles_do() {
    let beyond = [-1e9, -745.0, 0.0, 710.0, 1e9, f64::NAN];
    let results = Width::widest().run(Each(&beyond, Exponential));
    assert_eq!(results[..5], [0.0, 0.0, 1.0, f64::INFINITY, f64::INFINITY]);
    assert!(results[5].is_nan());
}

#[test]
fn a_ceiling_is_the_next_whole_number() {
    let numbers = [0.0, 0.2, 0.5, 1.0, 1.5, 2.500_001, 1e6 + 0.1];
    let results = Width::widest().run(Each(&numbers, Ceiling));
    assert_eq!(results, numbers.map(f64::ceil));
}

#[test]
fn lanes_give_the_same_numbers_in_vectors_of_any_width() {
    let numbers = numbers(30.0);
    let widest = Width::widest();
    for width in Width::all() {
        for (ours, theirs) in [
            (width.run(Each(&numbers, Sine)), widest.run(Each(&numbers, Sine))),
            (width.run(Each(&numbers, Cosine)), widest.run(Each(&numbers, Cosine))),
            (width.run(Each(&numbers, Exponential)), widest.run(Each(&numbers, Exponential))),
            (width.run(Each(&numbers, Acceleration)), widest.run(Each(&numbers, Acceleration))),
        ] {
            let bits = |numbers: &[f64]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert!(bits(&ours) == bits(&theirs), "{width:?}");
        }
    }
}

/// How something is held: a value whose variant decides the formula.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hold<T> {
    Free,
    Spring(T),
    Damped(T, T),
}
lift! { enum Hold<T> { Free, Spring(stiffness), Damped(stiffness, damping) } }

#[derive(Clone, Copy, Debug, PartialEq)]
struct Joint<T> {
    hold: Hold<T>,
    limit: Option<T>,
}
lift! { struct Joint<T> { hold, limit } }

/// The first of some joints lifted, the others put into the lanes after it.
struct InLanes<'a>(&'a [Joint<f64>]);

impl Work for InLanes<'_> {
    type Output = Vec<Joint<f64>>;
    fn run<T: Lanes>(self) -> Vec<Joint<f64>> {
        let mut all = self.0[0].lift::<T, 2>();
        let joints = &self.0[..self.0.len().min(T::COUNT)];
        for (lane, joint) in joints.iter().enumerate().skip(1) {
            joint.put::<T, 2>(&mut all, lane);
        }
        let of_lane = |lane: usize| Joint {
            hold: match all.hold {
                Hold::Free => Hold::Free,
                Hold::Spring(stiffness) => Hold::Spring(stiffness.get(lane)),
                Hold::Damped(stiffness, damping) => {
                    Hold::Damped(stiffness.get(lane), damping.get(lane))
                }
            },
            limit: all.limit.map(|limit| limit.get(lane)),
        };
        (0..joints.len()).map(of_lane).collect()
    }
}

#[test]
fn each_lane_of_an_enum_and_an_option_has_its_own_numbers() {
    let spring = |i: f64| Joint { hold: Hold::Spring(i), limit: Some(10.0 * i) };
    let damped = |i: f64| Joint { hold: Hold::Damped(i, -i), limit: None };
    let free = |_: f64| Joint { hold: Hold::Free, limit: None };
    let kinds: [fn(f64) -> Joint<f64>; 3] = [spring, damped, free];
    for joints in kinds.map(|joint| [1.0, 2.0, 3.0, 4.0].map(joint)) {
        for width in Width::all() {
            assert_eq!(width.run(InLanes(&joints)), joints, "{width:?}");
        }
        let shapes = joints.map(|joint| {
            let mut shape = lift::Shape::new();
            joint.shape(&mut shape);
            shape
        });
        assert!(shapes.iter().all(|shape| *shape == shapes[0]), "numbers make no shape");
    }
}

#[test]
fn values_with_different_formulas_have_different_shapes() {
    let shape = |hold, limit| {
        let mut shape = lift::Shape::new();
        Joint { hold, limit }.shape(&mut shape);
        shape
    };
    let all = [
        shape(Hold::Free, None),
        shape(Hold::Free, Some(1.0)),
        shape(Hold::Spring(1.0), None),
        shape(Hold::Damped(1.0, 1.0), None),
    ];
    for (i, one) in all.iter().enumerate() {
        assert!(all[..i].iter().all(|other| other != one), "{all:?}");
    }
}
