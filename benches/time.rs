//! Nanoseconds of each law, measured by criterion. A step takes no longer than a call through a
//! pointer or two, so it is inlined into criterion's loop.

use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main, measurement::WallTime};
use mtj_benches::{
    case::{Case, PASSES, Setting},
    meter::Meter,
};

criterion_group! {
    name = laws;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(600));
    targets = all
}
criterion_main!(laws);

fn all(criterion: &mut Criterion) {
    let settings = [Setting::LOOP, Setting::Paper];
    for (pass, setting) in (0..PASSES).flat_map(|pass| settings.map(|setting| (pass, setting))) {
        let mut group = criterion.benchmark_group(Case::group(setting, pass));
        for case in Case::all([setting].into_iter()) {
            let id = BenchmarkId::new(case.law.to_string(), case.links);
            case.measure(&mut Timer { group: &mut group, id });
        }
        group.finish();
    }
}

struct Timer<'a, 'b> {
    group: &'a mut criterion::BenchmarkGroup<'b, WallTime>,
    id: BenchmarkId,
}

impl Meter for Timer<'_, '_> {
    fn measure(&mut self, mut step: impl FnMut()) {
        self.group.bench_function(self.id.clone(), |bencher| bencher.iter(&mut step));
    }
}
