//! The Gram kernel beside the machine's peak of fused multiply-adds, both in multiply-adds a second of one
//! thread: `cargo bench --bench gram`. The kernel's are those that the sums need, n·p(p+1) for the two
//! triangles and n·p·r for the right-hand sides; what pads a triangle or a vector does not count.

#[path = "../src/denoise/gram.rs"]
#[allow(dead_code, reason = "the kernel's twin and its tests are not measured")]
mod gram;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gram::{Columns, Gram, LANES};
use pulp::{Arch, Simd, WithSimd};
use std::hint::black_box;

/// The programs' own.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Sums that are kept in flight: enough to hide the latency of two multiply-adds a cycle.
const CHAINS: usize = 12;

/// Multiply-adds of every chain.
const STEPS: usize = 10_000;

/// Multiply-adds of registers alone; returns how many.
struct Peak;

impl WithSimd for Peak {
    type Output = u64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> u64 {
        let (a, b) = (simd.splat_f32s(black_box(0.999)), simd.splat_f32s(black_box(1e-3)));
        let mut sums = [simd.splat_f32s(1.0); CHAINS];
        for _ in 0..STEPS {
            for sum in &mut sums {
                *sum = simd.mul_add_e_f32s(*sum, a, b);
            }
        }
        for sum in sums {
            black_box(simd.reduce_sum_f32s(sum));
        }
        (CHAINS * STEPS * size_of::<S::f32s>() / size_of::<f32>()) as u64
    }
}

/// The default's windows: 15×15 pixels, [1 | 7 features | 9 monomials], the colour and its pilot.
fn kernel(criterion: &mut Criterion) {
    let arch = Arch::new();
    let mut group = criterion.benchmark_group("fused multiply-adds");
    group.throughput(Throughput::Elements(arch.dispatch(Peak)));
    group.bench_function("peak", |bencher| bencher.iter(|| arch.dispatch(Peak)));

    let (pixels, p, r) = (15 * 15usize, 17, 6);
    let stride = pixels.next_multiple_of(LANES);
    let ramp = |n: usize| (0..n).map(|i| (i % 13) as f32 / 13.0).collect::<Vec<_>>();
    let (data, weights, weighted_noise) = (ramp((p + r) * stride), ramp(stride), ramp(stride));
    let columns = Columns { data: &data, stride, p, r, weights: &weights, weighted_noise: &weighted_noise };
    let mut sums = Gram::default();
    group.throughput(Throughput::Elements((pixels * (p * (p + 1) + p * r)) as u64));
    group.bench_function("gram", |bencher| {
        bencher.iter(|| gram::accumulate(arch, black_box(columns), &mut sums));
    });
    group.finish();
}

criterion_group!(benches, kernel);
criterion_main!(benches);
