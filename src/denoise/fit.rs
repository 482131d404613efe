//! One factorisation gives every order (nested Cholesky).
//!
//! The columns are taken in an order that tells what they are worth: by default the design's, in which the models nest:
//! [1 | features | x, y | x², xy, y² | cubic]. With A = L Lᵀ, z_t = L⁻¹ b_t and d = diag(L⁻¹ B L⁻ᵀ) the leading block of
//! size p_k holds all there is to know of the model with p_k columns: its coefficients, its residual Σ w y² − Σ z², its
//! noise gain Σ d.
//! In the basis of z the columns are orthonormal, so that leaving a model's last columns out, or
//! shrinking them, is a multiplication of z.
//!
//! A is equilibrated to a unit diagonal first, and a column whose pivot falls under
//! [`PIVOT_THRESHOLD`] is one that the columns before it explain: it is dropped (z = d = 0).

use super::gram::Gram;

/// A pivot below this share of its column's energy counts as zero. The Gram matrices are good to 1e-6,
/// so what is kept has at least three digits. `[choice]` 1e-4, 1e-3, 3e-3 and 1e-2: relMSE ×1.004, ×1, ×0.999 and ×1.003 on
/// five scenes, ×1.011, ×1, ×0.995 and ×0.991 on thirteen others (16 to 256 spp). Beyond 1e-3 a picture and its transpose
/// differ visibly: of two columns that explain one another the latter is dropped. 1e-5 may give NaN.
pub const PIVOT_THRESHOLD: f64 = 1e-3;

/// Numbers that are taken at once.
const BLOCK: usize = 4;

/// The factorisation of one window's normal equations; buffers are kept between windows.
#[derive(Debug, Clone, Default)]
pub struct Factor {
    p: usize,
    /// Which column each component belongs to.
    order: Vec<usize>,
    /// 1/√A_ii, 0 for an empty column, in that order.
    scale: Vec<f64>,
    /// L of the equilibrated A, row major; a dropped column has L_ii = 0.
    l: Vec<f64>,
    /// L⁻¹ b, one row of p per right-hand side.
    z: Vec<f64>,
    /// diag(L⁻¹ B L⁻ᵀ).
    d: Vec<f64>,
    /// Rows of A from the diagonal on, with b behind; row j, when it is done, is u: column j of L, then z_j.
    system: Rows,
    /// Rows of B from the diagonal on; row j, when it is done, is v.
    noise: Rows,
    /// The rows that are done and were not dropped.
    kept: Vec<Kept>,
    /// Coefficients, one row of p per right-hand side; and those of one block of them side by side.
    beta: Vec<f64>,
    block: Vec<[f64; BLOCK]>,
}

/// What an earlier row takes out of the row at hand.
#[derive(Debug, Clone, Copy, Default)]
struct Kept {
    row: usize,
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
    /// Factorises `gram`, which has `p` columns and `r` right-hand sides, its columns in their order.
    #[inline(always)]
    pub fn factorise(&mut self, gram: &Gram, p: usize, r: usize) {
        self.order.clear();
        self.order.extend(0..p);
        self.factorise_ordered(gram, p, r);
    }

    /// The same with the columns in this `order`.
    #[inline(always)]
    pub fn factorise_in(&mut self, order: &[usize], gram: &Gram, r: usize) {
        self.order.clear();
        self.order.extend_from_slice(order);
        self.factorise_ordered(gram, order.len(), r);
    }

    #[inline(always)]
    fn factorise_ordered(&mut self, gram: &Gram, p: usize, r: usize) {
        self.p = p;
        self.equilibrate(gram, r);
        for buffer in [&mut self.l, &mut self.z, &mut self.d] {
            buffer.clear();
        }
        self.l.resize(p * p, 0.0);
        self.z.resize(r * p, 0.0);
        self.d.resize(p, 0.0);
        self.kept.clear();
        for j in 0..p {
            self.eliminate(j);
        }
    }

    /// Copies A, b and B to where they are eliminated, A to a unit diagonal.
    #[inline(always)]
    fn equilibrate(&mut self, gram: &Gram, r: usize) {
        let (p, width) = (self.p, self.p + r);
        self.scale.clear();
        self.scale.extend(self.order.iter().map(|i| gram.equilibration(*i, width)));
        self.system.resize(p, width);
        self.noise.resize(p, p);
        for i in 0..p {
            let (own, row) = (self.scale[i], self.order[i]);
            let (system, noise) = (self.system.row_mut(i), self.noise.row_mut(i));
            // From the diagonal on; from there to the block's beginning nothing is ever looked at.
            for ((j, &column), scale) in self.order.iter().enumerate().zip(&self.scale).skip(i) {
                let scale = own * scale;
                system[j] = f64::from(gram.a[Gram::place(row, column, width)]) * scale;
                noise[j] = f64::from(gram.b[Gram::place(row, column, p)]) * scale;
            }
            let (columns, padding) = system[p..].split_at_mut(r);
            let sides = &gram.a[row * width + p..(row + 1) * width];
            columns.iter_mut().zip(sides).for_each(|(to, side)| *to = f64::from(*side) * own);
            padding.fill(0.0);
            noise[p..].fill(0.0);
        }
    }

    /// Finishes row `j`: what all earlier ones take out of it, A by its Cholesky step, b with it, and B by the
    /// congruence B ← E B Eᵀ whose E is that step. With u = L's column i and v = B_i/L_ii − ½ d_i u of every
    /// earlier i the latter is B_jk ← B_jk − u_j v_k − v_j u_k, and d_j = B_jj/A_jj.
    #[inline(always)]
    fn eliminate(&mut self, j: usize) {
        let p = self.p;
        let (system, noise) = (&self.system, &self.noise);
        for kept in &mut self.kept {
            (kept.u, kept.v) = (system.row(kept.row)[j], noise.row(kept.row)[j]);
            self.l[j * p + kept.row] = kept.u;
        }
        let from = j / BLOCK;
        for at in (from..self.system.width).step_by(AT_ONCE) {
            with_blocks!(self.system.width - at, self.take_from_system(j, at));
        }
        for at in (from..self.noise.width).step_by(AT_ONCE) {
            with_blocks!(self.noise.width - at, self.take_from_noise(j, at));
        }
        let pivot = self.system.row(j)[j];
        if pivot.is_nan() || pivot <= PIVOT_THRESHOLD {
            return;
        }
        let inverse = pivot.sqrt().recip();
        let d = self.noise.row(j)[j] / pivot;
        self.d[j] = d.max(0.0);
        let (u, v) = (self.system.row_mut(j), self.noise.row_mut(j));
        u[from * BLOCK..].iter_mut().for_each(|u| *u *= inverse);
        for (v, u) in v[from * BLOCK..].iter_mut().zip(&u[from * BLOCK..]) {
            *v = *v * inverse - 0.5 * d * u;
        }
        for (t, z) in u[p..].iter().enumerate().take(self.z.len() / p) {
            self.z[t * p + j] = *z;
        }
        self.l[j * p + j] = u[j];
        self.kept.push(Kept { row: j, ..Kept::default() });
    }

    /// Takes the earlier rows out of `N` blocks of A's and b's row `j` from block `at` on.
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
        for z in self.z[..targets * p].chunks(BLOCK * p) {
            self.block.clear();
            self.block.resize(p, [0.0; BLOCK]);
            for (t, z) in z.chunks_exact(p).enumerate() {
                self.block.iter_mut().zip(z).zip(shrink).for_each(|((beta, z), s)| beta[t] = z * s);
            }
            for i in (0..p).rev() {
                let row = &self.l[i * p..=i * p + i];
                let (before, own) = self.block.split_at_mut(i);
                let own = &mut own[0];
                if row[i] > 0.0 {
                    own.iter_mut().for_each(|beta| *beta /= row[i]);
                    for (beta, l) in before.iter_mut().zip(row) {
                        (0..BLOCK).for_each(|t| beta[t] -= l * own[t]);
                    }
                } else {
                    *own = [0.0; BLOCK];
                }
            }
            for t in 0..z.len() / p {
                let start = self.beta.len();
                self.beta.resize(start + p, 0.0);
                for ((column, beta), scale) in self.order.iter().zip(&self.block).zip(&self.scale) {
                    self.beta[start + column] = beta[t] * scale;
                }
            }
        }
    }

    /// The coefficients of right-hand side `t` that were solved for last.
    pub fn beta(&self, t: usize) -> &[f64] {
        &self.beta[t * self.p..(t + 1) * self.p]
    }
}
