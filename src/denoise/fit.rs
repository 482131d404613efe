//! One factorisation gives every order (nested Cholesky).
//!
//! With A = L Lᵀ, z_t = L⁻¹ b_t and d = diag(L⁻¹ B L⁻ᵀ) the leading block of size p_k holds all there is to know of the
//! model with the first p_k columns: its coefficients, its residual Σ w y² − Σ z², its noise gain Σ d.
//! In the basis of z the columns are orthonormal, so that leaving a model's last columns out, or
//! shrinking them, is a multiplication of z.
//!
//! The columns have their turn in the design's order, in which the models nest:
//! [1 | features | x, y | x², xy, y² | cubic]; or in that of [`super::pursuit`], and then not all of them.
//!
//! A is equilibrated to a unit diagonal first, and a column whose pivot falls under
//! [`PIVOT_THRESHOLD`] is one that the columns before it explain: it is dropped (z = d = 0). So is one of whose pivot
//! nothing but its own noise is left ([`NOISE_MARGIN`]).

use super::gram::Gram;
use super::pursuit::Pursuit;
use std::ops::Range;

/// A pivot below this share of its column's energy counts as zero. The Gram matrices are good to 1e-6,
/// so what is kept has at least three digits. `[choice]` 1e-4, 1e-3, 3e-3 and 1e-2: relMSE ×1.004, ×1, ×0.999 and ×1.003 on
/// five scenes, ×1.011, ×1, ×0.995 and ×0.991 on thirteen others (16 to 256 spp). Beyond 1e-3 a picture and its transpose
/// differ visibly: of two columns that explain one another the latter is dropped. 1e-5 may give NaN.
pub const PIVOT_THRESHOLD: f64 = 1e-3;

/// A column's pivot must be this many times what its own noise is of it. The depth of a pixel on a slope is that of where
/// its samples happened to fall: its noise, which the prefilter leaves a part of, is also the colour's at the rim of a
/// lamp, and along that rim, where all depths are alike, it passed for detail: the rim stayed as noisy as it was.
/// `[choice]` of 0, 2, 4 and 8: relMSE ×1, ×1.000, ×1.000, ×1.000 on five scenes, ×1, ×0.994, ×0.993, ×0.992 on thirteen
/// others, ×1, ×0.998, ×0.998, ×0.998 on seventeen; MSE at 4 ×1.000, ×0.970, ×0.986 (16 to 256 spp), at worst ×1.01, a
/// lamp's box at 16 spp ×0.81 and its MSE ×0.42. A part of every component instead, 1 − noise/pivot: ×1.001, ×0.993.
const NOISE_MARGIN: f64 = 4.0;

/// Numbers that are taken at once.
const BLOCK: usize = 4;

/// The factorisation of one window's normal equations; buffers are kept between windows.
#[derive(Debug, Clone, Default)]
pub struct Factor {
    p: usize,
    /// Whether the columns had their turn in the design's order.
    nested: bool,
    /// Which column each component belongs to.
    order: Vec<usize>,
    /// 1/√A_ii of every column, 0 for an empty one.
    scale: Vec<f64>,
    /// What each column's pivot must be above.
    floor: Vec<f64>,
    /// L⁻¹ b, one row of p per right-hand side.
    z: Vec<f64>,
    /// diag(L⁻¹ B L⁻ᵀ).
    d: Vec<f64>,
    /// For every component u, its column of L by the columns of the design, and its z behind.
    system: Rows,
    /// For every component v.
    noise: Rows,
    /// The components that were not dropped.
    kept: Vec<Kept>,
    pursuit: Pursuit,
    /// Coefficients, one row of p per right-hand side; and those of one block of them side by side, by components.
    beta: Vec<f64>,
    block: Vec<[f64; BLOCK]>,
}

/// A component, and what it takes out of the row at hand.
#[derive(Debug, Clone, Copy, Default)]
struct Kept {
    row: usize,
    column: usize,
    /// Its u and v at the column of the row at hand.
    u: f64,
    v: f64,
}

/// A matrix whose rows are whole blocks long.
#[derive(Debug, Clone, Default)]
struct Rows {
    data: Vec<[f64; BLOCK]>,
    /// Blocks of a row.
    width: usize,
}

impl Rows {
    #[inline(always)]
    fn resize(&mut self, rows: usize, columns: usize) {
        self.width = columns.div_ceil(BLOCK);
        self.data.resize(rows * self.width, [0.0; BLOCK]);
    }

    #[inline(always)]
    fn row(&self, i: usize) -> &[f64] {
        self.data[i * self.width..(i + 1) * self.width].as_flattened()
    }

    #[inline(always)]
    fn row_mut(&mut self, i: usize) -> &mut [f64] {
        self.data[i * self.width..(i + 1) * self.width].as_flattened_mut()
    }

    /// `N` blocks of row `i`, the first of which is `from`.
    #[inline(always)]
    fn blocks<const N: usize>(&self, i: usize, from: usize) -> &[[f64; BLOCK]; N] {
        let start = i * self.width + from;
        self.data[start..start + N].try_into().expect("N blocks")
    }
}

/// The most blocks of a row that are summed in registers at once.
const AT_ONCE: usize = 6;

/// Calls `$f::<N>` with N the number of blocks, `$n`, from 1 to [`AT_ONCE`]: the compiler keeps so many sums in
/// registers where it knows how many they are.
macro_rules! with_blocks {
    ($n:expr, $self:ident.$f:ident($($argument:expr),*)) => {
        match $n {
            1 => $self.$f::<1>($($argument),*),
            2 => $self.$f::<2>($($argument),*),
            3 => $self.$f::<3>($($argument),*),
            4 => $self.$f::<4>($($argument),*),
            5 => $self.$f::<5>($($argument),*),
            _ => $self.$f::<AT_ONCE>($($argument),*),
        }
    };
}

impl Factor {
    /// Factorises `gram`, which has a column for every one of `noise` and `r` right-hand sides, in the design's order.
    /// `noise` is Σ w σ² of what is known to be the columns' own.
    #[inline(always)]
    pub fn factorise(&mut self, gram: &Gram, noise: &[f64], r: usize) {
        self.start(gram, noise, r, true);
        (0..noise.len()).for_each(|column| self.eliminate(gram, column));
    }

    /// The same in the order of what the right-hand sides of `pilot` tell, and no farther than that.
    #[inline(always)]
    pub fn pursue(&mut self, gram: &Gram, noise: &[f64], r: usize, pilot: Range<usize>) {
        let p = noise.len();
        self.start(gram, noise, r, false);
        self.pursuit.start(gram, &self.scale, r, pilot.clone());
        let mut next = Some(0);
        while let Some(column) = next {
            let row = self.order.len();
            self.eliminate(gram, column);
            let z = |t: usize| self.z[t * p + row];
            self.pursuit.take(
                column,
                &self.system.row(row)[..p],
                &self.noise.row(row)[..p],
                pilot.clone().map(z),
            );
            next = self.pursuit.next(&self.floor);
        }
    }

    #[inline(always)]
    fn start(&mut self, gram: &Gram, noise: &[f64], r: usize, nested: bool) {
        let p = noise.len();
        (self.p, self.nested) = (p, nested);
        let energy = |i: usize| f64::from(gram.a[i * (p + r) + i]);
        let scale = |energy: f64| if energy > f64::MIN_POSITIVE { energy.sqrt().recip() } else { 0.0 };
        self.scale.clear();
        self.scale.extend((0..p).map(|i| scale(energy(i))));
        let own = noise.iter().zip(&self.scale).map(|(noise, scale)| noise * (scale * scale));
        self.floor.clear();
        self.floor.extend(own.map(|own| (NOISE_MARGIN * own).max(PIVOT_THRESHOLD)));
        self.system.resize(p, p + r);
        self.noise.resize(p, p);
        for (buffer, length) in [(&mut self.z, r * p), (&mut self.d, p)] {
            buffer.clear();
            buffer.resize(length, 0.0);
        }
        self.order.clear();
        self.kept.clear();
    }

    /// The first block of component `i`'s row that is looked at: columns that had their turn are not, where it is known
    /// which they are.
    #[inline(always)]
    fn first(&self, i: usize) -> usize {
        if self.nested { i / BLOCK } else { 0 }
    }

    /// Makes the next component, of `column`: all earlier ones are taken out of it, of A by the Cholesky step, of b with
    /// it, and of B by the congruence B ← E B Eᵀ whose E is that step. With u = L's column i and v = B_i/L_ii − ½ d_i u of
    /// every earlier i the latter is B_jk ← B_jk − u_j v_k − v_j u_k, and d_j = B_jj/A_jj.
    #[inline(always)]
    fn eliminate(&mut self, gram: &Gram, column: usize) {
        let (p, j) = (self.p, self.order.len());
        let from = self.first(j);
        self.order.push(column);
        self.equilibrate(gram, column, j, from * BLOCK);
        let (system, noise) = (&self.system, &self.noise);
        for kept in &mut self.kept {
            (kept.u, kept.v) = (system.row(kept.row)[column], noise.row(kept.row)[column]);
        }
        for at in (from..self.system.width).step_by(AT_ONCE) {
            with_blocks!(self.system.width - at, self.take_from_system(j, at));
        }
        for at in (from..self.noise.width).step_by(AT_ONCE) {
            with_blocks!(self.noise.width - at, self.take_from_noise(j, at));
        }
        let pivot = self.system.row(j)[column];
        if pivot.is_nan() || pivot <= self.floor[column] {
            return;
        }
        let inverse = pivot.sqrt().recip();
        let d = self.noise.row(j)[column] / pivot;
        self.d[j] = d.max(0.0);
        let (u, v) = (self.system.row_mut(j), self.noise.row_mut(j));
        u[from * BLOCK..].iter_mut().for_each(|u| *u *= inverse);
        for (v, u) in v[from * BLOCK..].iter_mut().zip(&u[from * BLOCK..]) {
            *v = *v * inverse - 0.5 * d * u;
        }
        for (t, z) in u[p..].iter().enumerate().take(self.z.len() / p) {
            self.z[t * p + j] = *z;
        }
        self.kept.push(Kept { row: j, column, ..Kept::default() });
    }

    /// Copies what A, b and B have of `column` from column `from` on to row `j`, A to a unit diagonal.
    #[inline(always)]
    fn equilibrate(&mut self, gram: &Gram, column: usize, j: usize, from: usize) {
        let (p, r, own) = (self.p, self.z.len() / self.p, self.scale[column]);
        let scales = &self.scale[from..];
        let copy = |to: &mut [f64], sums: &[f32]| {
            for ((to, sum), scale) in to[from..].iter_mut().zip(&sums[from..]).zip(scales) {
                *to = f64::from(*sum) * (own * scale);
            }
        };
        let row = &gram.a[column * (p + r)..(column + 1) * (p + r)];
        let (system, noise) = (self.system.row_mut(j), self.noise.row_mut(j));
        copy(&mut system[..p], &row[..p]);
        copy(&mut noise[..p], &gram.b[column * p..(column + 1) * p]);
        system[p..].iter_mut().zip(&row[p..]).for_each(|(to, sum)| *to = f64::from(*sum) * own);
        system[p + r..].fill(0.0);
        noise[p..].fill(0.0);
    }

    /// Takes the earlier components out of `N` blocks of A's and b's row `j` from block `at` on.
    #[inline(always)]
    fn take_from_system<const N: usize>(&mut self, j: usize, at: usize) {
        let mut sums = *self.system.blocks::<N>(j, at);
        for kept in &self.kept {
            let u = self.system.blocks::<N>(kept.row, at);
            for (sums, u) in sums.iter_mut().zip(u) {
                (0..BLOCK).for_each(|k| sums[k] -= kept.u * u[k]);
            }
        }
        let start = j * self.system.width + at;
        self.system.data[start..start + N].copy_from_slice(&sums);
    }

    /// The same of B.
    #[inline(always)]
    fn take_from_noise<const N: usize>(&mut self, j: usize, at: usize) {
        let mut sums = *self.noise.blocks::<N>(j, at);
        for kept in &self.kept {
            let (u, v) = (self.system.blocks::<N>(kept.row, at), self.noise.blocks::<N>(kept.row, at));
            for ((sums, u), v) in sums.iter_mut().zip(u).zip(v) {
                (0..BLOCK).for_each(|k| sums[k] -= kept.u * v[k] + kept.v * u[k]);
            }
        }
        let start = j * self.noise.width + at;
        self.noise.data[start..start + N].copy_from_slice(&sums);
    }

    /// Which column each component belongs to.
    pub fn order(&self) -> &[usize] {
        &self.order
    }

    /// L⁻¹ b of right-hand side `t`.
    pub fn z(&self, t: usize) -> &[f64] {
        &self.z[t * self.p..(t + 1) * self.p]
    }

    /// diag(L⁻¹ B L⁻ᵀ).
    pub fn d(&self) -> &[f64] {
        &self.d
    }

    /// Solves for the coefficients L⁻ᵀ (shrink ∘ z_t), in the units of the columns, of the first `targets`
    /// right-hand sides, [`BLOCK`] of them at once.
    #[inline(always)]
    pub fn solve(&mut self, targets: usize, shrink: &[f64]) {
        let p = self.p;
        self.beta.clear();
        self.beta.resize(targets * p, 0.0);
        self.block.resize(self.kept.len(), [0.0; BLOCK]);
        for (z, beta) in self.z[..targets * p].chunks(BLOCK * p).zip(self.beta.chunks_mut(BLOCK * p)) {
            for (i, kept) in self.kept.iter().enumerate().rev() {
                let u = self.system.row(kept.row);
                let (own, after) = self.block[i..].split_first_mut().expect("a component has a place");
                *own = [0.0; BLOCK];
                for (own, z) in own.iter_mut().zip(z.chunks_exact(p)) {
                    *own = z[kept.row] * shrink[kept.row];
                }
                for (later, beta) in self.kept[i + 1..].iter().zip(&*after) {
                    (0..BLOCK).for_each(|t| own[t] -= u[later.column] * beta[t]);
                }
                own.iter_mut().for_each(|beta| *beta /= u[kept.column]);
                for (t, beta) in beta.chunks_exact_mut(p).enumerate() {
                    beta[kept.column] = own[t] * self.scale[kept.column];
                }
            }
        }
    }

    /// The coefficients of right-hand side `t` that were solved for last.
    pub fn beta(&self, t: usize) -> &[f64] {
        &self.beta[t * self.p..(t + 1) * self.p]
    }
}
