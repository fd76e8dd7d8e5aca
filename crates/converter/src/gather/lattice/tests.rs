use pointmill_format::{Aabb, AxisGrid, Lattice};

use super::*;
use crate::cloud::{JobBounds, JobPoint, SourceStats};
use crate::sources::{Fineness, Schema, Source, Stored, Tolerance};

fn grid(step: f64) -> Fineness {
    Fineness::Grid { grid: AxisGrid { step, offset: 0.0 }, is_claim: true }
}

fn world(fineness: [Fineness; 3], min: [f64; 3], max: [f64; 3]) -> Source {
    let stored = Stored { lattice: None, resolution: Default::default(), fineness };
    Source::of_header(stored, None, Some(Aabb { min, max }))
}

fn with_lattice(lattice: Lattice, bounds: Option<Aabb>) -> Source {
    let fineness = std::array::from_fn(|a| {
        let grid = AxisGrid { step: lattice.scale[a], offset: lattice.offset[a] };
        Fineness::Grid { grid, is_claim: false }
    });
    let stored = Stored { lattice: Some(lattice), resolution: Default::default(), fineness };
    Source::of_header(stored, bounds, bounds)
}

fn sources(all: Vec<Source>) -> Sources {
    Sources::of_headers(all)
}

fn plan(scale: ScaleChoice) -> Plan {
    let mut plan = Plan::new(vec!["x".into()], "out".into());
    plan.scale = scale;
    plan
}

fn chosen(all: Vec<Source>) -> JobLattice {
    from_headers(&plan(ScaleChoice::Auto), &sources(all)).unwrap()
}

fn lattice(step: f64, offset: [f64; 3]) -> Lattice {
    Lattice { scale: [step; 3], offset }
}

/// Points of one source that were read with `lattice`.
fn stats(bounds: JobBounds, lattice: &Lattice, off_grid: [bool; 3]) -> Stats {
    let mut stats = Stats::new(&Schema::new(Vec::new()));
    stats.sources = vec![SourceStats::default()];
    stats.bounds = bounds;
    stats.sources[0].bounds = Aabb { min: lattice.world(bounds.min.0), max: lattice.world(bounds.max.0) };
    stats.sources[0].off_grid = off_grid;
    stats
}

#[test]
fn sources_that_agree_keep_their_lattice_and_others_get_one_that_holds_all() {
    let a = lattice(0.01, [100.0, 0.0, 0.0]);
    let b = lattice(0.001, [200.0, 0.0, -5.0]);
    let both = |x, y| chosen(vec![with_lattice(x, None), with_lattice(y, None)]).lattice;
    assert_eq!(both(a, a), a);
    assert_eq!(both(a, b), b);
    assert_eq!(both(lattice(0.01, [0.0; 3]), lattice(0.025, [0.0; 3])).scale, [0.005; 3]);
    let fixed = |step| {
        from_headers(&plan(ScaleChoice::Fixed(step)), &sources(vec![with_lattice(a, None), with_lattice(b, None)]))
    };
    assert_eq!(fixed(0.5).unwrap().lattice.offset, [0.0, 0.0, 0.0]);
    assert_eq!(fixed(0.3).unwrap().lattice.offset, [100.0, 0.0, -5.0]);
}

#[test]
fn declared_bounds_however_wide_do_not_make_the_lattice_of_sources_coarser() {
    let own = lattice(0.001, [0.0; 3]);
    let lie = Aabb { min: [-1e12; 3], max: [1e12; 3] };
    assert_eq!(chosen(vec![with_lattice(own, Some(lie))]).lattice, own);
}

#[test]
fn doubles_get_the_finest_step_that_31_bits_hold() {
    let step = |min, max| chosen(vec![world([Fineness::Double; 3], min, max)]).lattice.scale;
    assert_eq!(step([0.0; 3], [1000.0, 10.0, 10.0]), [5e-7; 3]);
    assert_eq!(step([0.0; 3], [2e6; 3]), [1e-3; 3]);
    // two numbers near 10^7 a millimetre apart: doubles resolve 1.9e-9
    assert_eq!(step([1e7; 3], [1e7 + 1e-3; 3]), [5e-9; 3]);
    // degrees with heights: equal steps would be half a decimetre on the ground
    assert_eq!(step([13.0, 52.0, 0.0], [13.5, 52.5, 1000.0]), [5e-10, 5e-10, 5e-7]);
}

#[test]
fn decimals_are_kept_where_the_integers_hold_them_and_stay_decimal_where_not() {
    let step = |decimal, extent| {
        let c = chosen(vec![world([grid(decimal); 3], [0.0; 3], [extent; 3])]);
        (c.lattice.scale[0], c.reason.axes[0].coarser.map(|c| c.factor))
    };
    assert_eq!(step(0.001, 600_000.0), (0.001, None), "6e8 steps fit 31 bits");
    assert_eq!(step(0.001, 2_100_000.0), (0.001, None));
    assert_eq!(step(0.001, 2_200_000.0), (0.002, Some(2.0)));
    assert_eq!(step(0.001, 9_000_000.0), (0.005, Some(5.0)));
    let degrees = [grid(1e-8), grid(1e-8), grid(0.01)];
    let c = chosen(vec![world(degrees, [13.0, 52.0, 0.0], [13.5, 52.5, 1000.0])]);
    assert_eq!(c.lattice.scale, [1e-8, 1e-8, 0.01], "a step for each axis");
    let uneven = chosen(vec![world([grid(0.001), grid(0.001), grid(0.01)], [0.0; 3], [100.0; 3])]);
    assert_eq!(uneven.lattice.scale, [0.001; 3], "near steps are equal");
}

#[test]
fn single_precision_gets_its_own_step_per_axis_and_no_finer() {
    let single = [Fineness::Single; 3];
    let c = chosen(vec![world(single, [499_000.0, 5_400_000.0, 90.0], [500_000.0, 5_401_000.0, 100.0])]);
    assert_eq!(c.lattice.scale, [2f64.powi(-5), 0.5, 2f64.powi(-17)]);
    // an axis near 0 would ask for more than 31 bits of another
    let wide = chosen(vec![world(single, [0.0, 0.0, 0.0], [1e6, 1e6, 1e-3])]);
    assert_eq!(wide.lattice.scale[..2], [2f64.powi(-4); 2]);
    let flat = chosen(vec![world(single, [0.0; 3], [1.0, 1.0, 0.0])]);
    assert_eq!(flat.lattice.scale, [2f64.powi(-23); 3], "a flat axis asks for nothing");
}

#[test]
fn a_source_that_resolves_little_makes_the_others_neither_finer_nor_coarser() {
    let own = with_lattice(lattice(0.001, [0.5, 0.0, 0.0]), None);
    let far = world([Fineness::Single; 3], [499_000.0, 5_400_000.0, 900.0], [500_000.0, 5_401_000.0, 990.0]);
    let c = chosen(vec![own, far]).lattice;
    assert_eq!((c.scale, c.offset), ([0.001, 0.001, 0.0001], [0.5, 0.0, 0.0]));
    let own = with_lattice(lattice(0.01, [0.0; 3]), None);
    let step = world([Fineness::Step(0.02); 3], [0.0; 3], [1000.0; 3]);
    assert_eq!(chosen(vec![own, step]).lattice.scale, [0.01; 3]);
}

#[test]
fn a_step_is_at_least_two_distances_of_doubles() {
    let far = lattice(1e-7, [1e9, 0.0, 0.0]);
    let c = chosen(vec![with_lattice(far, None)]);
    assert_eq!(c.lattice.scale, [5e-7, 1e-7, 1e-7]);
    assert_eq!(c.reason.axes[0].coarser, Some(Coarser { factor: 5.0, cause: CoarserCause::Doubles }));
    let absurd = chosen(vec![with_lattice(lattice(0.01, [1e16; 3]), None)]);
    assert_eq!(absurd.lattice.scale, [5.0; 3]);
}

#[test]
fn points_that_were_read_make_it_coarser_or_finer() {
    let auto = plan(ScaleChoice::Auto);
    let wide = JobBounds { min: JobPoint([0; 3]), max: JobPoint([3_000_000_000, 5, 5]) };
    let own = sources(vec![with_lattice(lattice(0.001, [0.0; 3]), None)]);
    let present = from_headers(&auto, &own).unwrap();
    let coarser = settled(&auto, &own, &present, &stats(wide, &present.lattice, [false; 3])).unwrap();
    assert_eq!(coarser.lattice.scale, [0.002, 0.001, 0.001], "only the axis that does not fit");
    let fits = JobBounds { min: JobPoint([0; 3]), max: JobPoint([2_000_000_000, 5, 5]) };
    assert_eq!(settled(&auto, &own, &present, &stats(fits, &present.lattice, [false; 3])), None);
    // a sample showed millimetres, a point has more
    let text = sources(vec![world([grid(0.001); 3], [0.0; 3], [100.0; 3])]);
    let present = from_headers(&auto, &text).unwrap();
    let seen = JobBounds { min: JobPoint([0; 3]), max: JobPoint([100_000; 3]) };
    assert_eq!(settled(&auto, &text, &present, &stats(seen, &present.lattice, [false; 3])), None);
    let finer = settled(&auto, &text, &present, &stats(seen, &present.lattice, [true, false, false])).unwrap();
    assert!(finer.lattice.scale[0] <= 1e-7, "{finer:?}");
    // declared bounds lied
    let lied = sources(vec![world([Fineness::Double; 3], [0.0; 3], [1e9; 3])]);
    let present = from_headers(&auto, &lied).unwrap();
    let small = JobBounds { min: JobPoint([0; 3]), max: JobPoint([200; 3]) };
    let finer = settled(&auto, &lied, &present, &stats(small, &present.lattice, [false; 3])).unwrap();
    assert!(finer.lattice.scale[0] < present.lattice.scale[0] / 1e6);
}

#[test]
fn reasons_are_one_line_however_many_axes_differ() {
    let far = chosen(vec![with_lattice(lattice(1e-7, [1e9, 0.0, 0.0]), None)]);
    let text = far.reason.to_string();
    assert!(text.contains("x: that of the sources; made 5 times coarser, because doubles"), "{text}");
    assert!(text.ends_with("z: that of the sources"), "{text}");
}

#[test]
fn headers_say_whether_the_step_is_coarser_than_that_of_sources() {
    let is = |scale, sources: &Sources| is_coarse(&plan(scale), sources).unwrap();
    let own = sources(vec![with_lattice(lattice(0.01, [0.0; 3]), None)]);
    assert_eq!([0.005, 0.01, 0.02].map(|step| is(ScaleChoice::Fixed(step), &own)), [false, false, true]);
    assert!(!is(ScaleChoice::Auto, &own));
    let flat = Lattice { scale: [0.01, 0.01, 0.001], offset: [0.0; 3] };
    assert!(is(ScaleChoice::Fixed(0.01), &sources(vec![with_lattice(flat, None)])), "one axis is enough");
    let mut doubles = sources(vec![world([Fineness::Double; 3], [0.0; 3], [1000.0; 3])]);
    assert!(!is(ScaleChoice::Auto, &doubles) && is(ScaleChoice::Fixed(1e-9), &doubles));
    doubles.tolerance = Some(Tolerance { total: [0.001; 3], lattice: [0.001; 3] });
    assert!(is(ScaleChoice::Auto, &doubles), "no more than is requested");
}

#[test]
fn a_loss_is_a_step_more_than_twice_that_of_the_sources_that_was_not_requested() {
    let bounds = JobBounds { min: JobPoint([0; 3]), max: JobPoint([100; 3]) };
    let lost = |sources: &Sources, scale: ScaleChoice, step: f64| {
        let plan = plan(scale);
        let present = from_headers(&plan, sources).unwrap();
        let made = JobLattice { lattice: lattice(step, [0.0; 3]), ..present };
        losses(&plan, sources, &present, &made, &stats(bounds, &present.lattice, [false; 3]))
    };
    let own = sources(vec![with_lattice(lattice(0.01, [0.0; 3]), None)]);
    assert_eq!(lost(&own, ScaleChoice::Auto, 0.02), [Loss::Nothing; 3]);
    assert_eq!(lost(&own, ScaleChoice::Auto, 0.05), [Loss::Of(0.01); 3]);
    assert_eq!(lost(&own, ScaleChoice::Fixed(0.05), 0.05), [Loss::Nothing; 3], "requested");
    let far = sources(vec![with_lattice(lattice(1e-7, [1e9; 3]), None)]);
    assert_eq!(
        lost(&far, ScaleChoice::Fixed(1e-7), 5e-7),
        [Loss::Of(1e-7); 3],
        "requested, and doubles do not hold it"
    );
    let mut doubles = sources(vec![world([Fineness::Double; 3], [0.0; 3], [1000.0; 3])]);
    assert_eq!(lost(&doubles, ScaleChoice::Auto, 0.01), [Loss::Unknown; 3]);
    doubles.tolerance = Some(Tolerance { total: [0.001; 3], lattice: [0.001; 3] });
    assert_eq!(lost(&doubles, ScaleChoice::Auto, 0.01), [Loss::Nothing; 3], "as coarse as was requested");
}

#[test]
fn scans_are_read_again_for_steps_that_are_much_finer_or_that_were_lost() {
    let auto = plan(ScaleChoice::Auto);
    let again = |sources: &Sources, present: f64, side: i64| {
        let present = JobLattice { lattice: lattice(present, [0.0; 3]), ..from_headers(&auto, sources).unwrap() };
        let bounds = JobBounds { min: JobPoint([0; 3]), max: JobPoint([side; 3]) };
        settled(&auto, sources, &present, &stats(bounds, &present.lattice, [false; 3])).map(|j| j.lattice.scale[0])
    };
    let own = sources(vec![with_lattice(lattice(0.01, [0.0; 3]), None)]);
    assert_eq!([0.01, 0.013, 0.015, 0.02].map(|step| again(&own, step, 9)), [None, None, Some(0.01), Some(0.01)]);
    // nobody knows how fine doubles are: for a hundredth
    let doubles = sources(vec![world([Fineness::Double; 3], [0.0; 3], [1e6; 3])]);
    let finer = |side: i64| again(&doubles, 0.001, side);
    assert_eq!([finer(2_000_000_000), finer(40_000_000), finer(20_000_000)], [None, None, Some(1e-5)]);
    assert_eq!(finer(3_000_000_000), Some(0.002), "integers do not hold them");
    let mut precise = sources(vec![world([Fineness::Double; 3], [0.0; 3], [1000.0; 3])]);
    precise.tolerance = Some(Tolerance { total: [0.01; 3], lattice: [0.01; 3] });
    assert_eq!([0.02, 0.021].map(|step| again(&precise, step, 9)), [None, Some(0.02)]);
}

#[test]
fn requested_steps_become_coarser_where_doubles_or_integers_do_not_hold_them() {
    let made = |step, sources: Vec<Source>| {
        let made = from_headers(&plan(ScaleChoice::Fixed(step)), &self::sources(sources)).unwrap();
        (made.lattice.scale[0], made.reason.axes[0].coarser.map(|c| (c.factor, c.cause)))
    };
    let doubles = |side: f64| vec![world([Fineness::Double; 3], [0.0; 3], [side; 3])];
    assert_eq!(made(0.001, doubles(2e6)), (0.001, None));
    assert_eq!(made(0.001, doubles(4e6)), (0.002, Some((2.0, CoarserCause::Extent))));
    let far = vec![with_lattice(lattice(1e-7, [1e9; 3]), None)];
    assert_eq!(made(1e-7, far), (5e-7, Some((5.0, CoarserCause::Doubles))));
}

#[test]
fn offsets_of_requested_steps_are_0_or_the_least_of_the_sources() {
    let offset = |offsets: [f64; 2], step| {
        let all = offsets.map(|o| with_lattice(lattice(0.001, [o; 3]), None));
        fixed_offset(&sources(all.into()), 1, step)
    };
    assert_eq!([offset([0.5, 2.0], 0.5), offset([0.5, 2.0], 0.25), offset([-1.5, 0.5], 0.5)], [0.0; 3]);
    assert_eq!([offset([0.5, 2.0], 1.0), offset([3.25, -0.5], 1.0)], [0.5, -0.5]);
    assert_eq!(offset([1.000_000_5, 2.0], 1.0), 0.0, "within a millionth of a step");
    assert_eq!(offset([1.000_002, 2.0], 1.0), 1.000_002);
}

/// A source whose integers lie on the coarser grid of `step`, as a sample of them shows.
fn with_divisor(own: Lattice, step: f64) -> Source {
    let stored = Stored { lattice: Some(own), resolution: Default::default(), fineness: [grid(step); 3] };
    Source::of_header(stored, None, None)
}

#[test]
fn a_second_read_is_for_another_lattice_only() {
    let auto = plan(ScaleChoice::Auto);
    let again = |sources: &Sources, present: f64, side: i64, off_grid| {
        let present = JobLattice { lattice: lattice(present, [0.0; 3]), ..from_headers(&auto, sources).unwrap() };
        let bounds = JobBounds { min: JobPoint([0; 3]), max: JobPoint([side; 3]) };
        settled(&auto, sources, &present, &stats(bounds, &present.lattice, [off_grid; 3])).map(|j| j.lattice.scale[0])
    };
    let own = |step| with_lattice(lattice(step, [0.0; 3]), None);
    // 0.005 holds both, but no coordinate is lost at 0.01
    let two = sources(vec![own(0.01), own(0.025)]);
    assert_eq!(chosen(vec![own(0.01), own(0.025)]).lattice.scale, [0.005; 3]);
    assert_eq!([0.01, 0.025].map(|present| again(&two, present, 9, false)), [None, Some(0.005)]);
    // the most steps that there may be
    let whole = sources(vec![own(1.0)]);
    assert_eq!([0, 1].map(|more| again(&whole, 1.0, (1 << 31) - 2 + more, false)), [None, Some(2.0)]);
    assert_eq!(again(&whole, 1.0, 9, true), None, "the points are off the grid, and there is no finer one");
    // a sample showed millimetres; now doubles of this extent ask for half of them
    let text = sources(vec![world([grid(0.001); 3], [0.0; 3], [1e6; 3])]);
    assert_eq!([false, true].map(|off| again(&text, 0.001, 1_000_000_000, off)), [None, Some(5e-4)]);
    let mut precise = sources(vec![world([Fineness::Double; 3], [0.0; 3], [1000.0; 3])]);
    precise.tolerance = Some(Tolerance { total: [0.0075; 3], lattice: [0.0075; 3] });
    assert_eq!(
        [0.015, 0.016].map(|step| again(&precise, step, 9, false)),
        [None, Some(0.01)],
        "as coarse as is allowed"
    );
}

#[test]
fn divisors_hold_until_a_point_contradicts_them() {
    let auto = plan(ScaleChoice::Auto);
    let source = || with_divisor(lattice(0.001, [0.0; 3]), 0.01);
    let present = chosen(vec![source()]);
    assert_eq!((present.lattice.scale, present.reason.axes[0].basis), ([0.01; 3], LatticeBasis::Divisor));
    let seen = JobBounds { min: JobPoint([0; 3]), max: JobPoint([100; 3]) };
    let settled =
        |off_grid| settled(&auto, &sources(vec![source()]), &present, &stats(seen, &present.lattice, off_grid));
    assert_eq!(settled([false; 3]), None);
    assert_eq!(settled([false, true, false]).unwrap().lattice.scale, [0.01, 0.001, 0.01]);
}

#[test]
fn free_axes_take_the_finest_step_and_its_reason() {
    let single = [Fineness::Single; 3];
    let c = chosen(vec![world(single, [5_400_000.0, 499_000.0, 0.0], [5_401_000.0, 500_000.0, 0.0])]);
    assert_eq!(c.lattice.scale, [0.5, 2f64.powi(-5), 2f64.powi(-5)]);
    assert_eq!(c.reason.axes[2], c.reason.axes[1]);
    let c = chosen(vec![world(single, [5_400_000.0, 5_500_000.0, 0.0], [5_401_000.0, 5_501_000.0, 0.0])]);
    assert_eq!((c.lattice.scale, c.reason.axes[2]), ([0.5; 3], c.reason.axes[0]), "of equals the first");
}

#[test]
fn steps_a_power_of_two_apart_or_far_apart_stay_unequal() {
    let single = [Fineness::Single; 3];
    let c =
        chosen(vec![world(single, [5_400_000.0, 1_200_000.0, 1_200_000.0], [5_400_100.0, 1_200_100.0, 1_200_100.0])]);
    assert_eq!(c.lattice.scale, [0.5, 0.125, 0.125]);
    let of = |steps: [f64; 3]| chosen(vec![world(steps.map(grid), [0.0; 3], [100.0; 3])]).lattice.scale;
    assert_eq!(of([0.3, 0.6, 0.3]), [0.3, 0.6, 0.3]);
    assert_eq!(of([0.001, 1.0, 0.001]), [0.001; 3], "a thousand times");
    assert_eq!(of([0.001, 2.0, 0.001]), [0.001, 2.0, 0.001]);
}

#[test]
fn only_a_sample_without_a_declaration_says_how_large_a_cloud_is() {
    let side = |max: f64| Aabb { min: [0.0; 3], max: [max; 3] };
    let decimals = || Stored { lattice: None, resolution: Default::default(), fineness: [grid(0.001); 3] };
    let wide = Some(side(9e6));
    assert_eq!(chosen(vec![Source::of_header(decimals(), None, wide)]).lattice.scale, [0.005; 3]);
    assert_eq!(chosen(vec![Source::of_header(decimals(), wide, wide)]).lattice.scale, [0.001; 3], "declared");
    let mut doubles = world([Fineness::Double; 3], [0.0; 3], [1000.0; 3]);
    if let Some(extent) = &mut doubles.extent {
        extent.is_sampled = true;
    }
    assert_eq!(chosen(vec![doubles]).lattice.scale, [1e-6; 3], "the rest may be as far again");
}

#[test]
fn a_source_without_points_asks_for_nothing() {
    let own = with_lattice(lattice(0.001, [0.0; 3]), None);
    let stored = Stored { lattice: None, resolution: Default::default(), fineness: [Fineness::Double; 3] };
    let mut both = sources(vec![own, Source::of_header(stored, None, None)]);
    both.tolerance = Some(Tolerance { total: [0.001; 3], lattice: [0.001; 3] });
    // all coordinates are known to be whole steps: three of them (docs/accuracy.md, section 10)
    assert_eq!(from_headers(&plan(ScaleChoice::Auto), &both).unwrap().lattice.scale, [0.003; 3]);
}

#[test]
fn the_lattice_inside_a_box_is_that_of_its_extent() {
    let auto = plan(ScaleChoice::Auto);
    let near = Aabb { min: [0.0; 3], max: [1000.0; 3] };
    let inside = |source: Source, present: f64, side: i64| {
        let all = sources(vec![source]);
        let present = JobLattice { lattice: lattice(present, [0.0; 3]), ..from_headers(&auto, &all).unwrap() };
        let bounds = JobBounds { min: JobPoint([0; 3]), max: JobPoint([side; 3]) };
        inside(&auto, &all, &present, &stats(bounds, &present.lattice, [false; 3]), &near).lattice.scale
    };
    assert_eq!(inside(world([Fineness::Double; 3], [0.0; 3], [1e9; 3]), 1.0, 1_000_000_000), [5e-7; 3]);
    assert_eq!(inside(with_lattice(lattice(0.001, [0.0; 3]), None), 0.002, 3_000_000_000), [0.001; 3]);
}
