//! One factorisation gives every order (nested Cholesky).
//!
//! The columns are ordered so that the models nest: [1 | features | x, y | x², xy, y² | cubic]. With
//! A = L Lᵀ, z_t = L⁻¹ b_t and d = diag(L⁻¹ B L⁻ᵀ) the leading block of size p_k holds all there is to
//! know of the model with p_k columns: its coefficients, its residual Σ w y² − Σ z², its noise gain Σ d.
//! In the basis of z the columns are orthonormal, so that leaving a model's last columns out, or
//! shrinking them, is a multiplication of z.
//!
//! A is equilibrated to a unit diagonal first, and a column whose pivot falls under
//! [`PIVOT_THRESHOLD`] is one that the columns before it explain: it is dropped (z = d = 0).

use super::gram::Gram;

/// A pivot below this share of its column's energy counts as zero. The Gram matrices are good to 1e-6,
/// so what is kept has at least three digits. `[choice]` at 1e-5 a prototype gave NaN.
pub const PIVOT_THRESHOLD: f64 = 1e-3;

/// Numbers that an update of a row takes at once.
const BLOCK: usize = 4;

/// The factorisation of one window's normal equations; buffers are kept between windows.
#[derive(Debug, Clone, Default)]
pub struct Factor {
    p: usize,
    /// 1/√A_ii, 0 for an empty column.
    scale: Vec<f64>,
    /// L of the equilibrated A, row major; a dropped column has L_ii = 0.
    l: Vec<f64>,
    /// L⁻¹ b, one row of p per right-hand side.
    z: Vec<f64>,
    /// diag(L⁻¹ B L⁻ᵀ).
    d: Vec<f64>,
    /// What is left to eliminate: rows of A from the diagonal on with b behind, and of B.
    system: Rows,
    noise: Rows,
}

/// A matrix whose rows are whole blocks long.
#[derive(Debug, Clone, Default)]
struct Rows {
    data: Vec<[f64; BLOCK]>,
    /// Blocks of a row.
    width: usize,
}

impl Rows {
    fn clear(&mut self, rows: usize, columns: usize) {
        self.width = columns.div_ceil(BLOCK);
        self.data.clear();
        self.data.resize(rows * self.width, [0.0; BLOCK]);
    }

    fn row_mut(&mut self, i: usize) -> &mut [f64] {
        self.data[i * self.width..(i + 1) * self.width].as_flattened_mut()
    }

    /// Row `j`, and the rows behind it.
    fn split(&mut self, j: usize) -> (&mut [[f64; BLOCK]], &mut [[f64; BLOCK]]) {
        self.data[j * self.width..].split_at_mut(self.width)
    }
}

impl Factor {
    /// Factorises `gram`, which has `p` columns and `r` right-hand sides.
    #[inline(always)]
    pub fn factorise(&mut self, gram: &Gram, p: usize, r: usize) {
        self.p = p;
        self.equilibrate(gram, r);
        for buffer in [&mut self.l, &mut self.z, &mut self.d] {
            buffer.clear();
        }
        self.l.resize(p * p, 0.0);
        self.z.resize(r * p, 0.0);
        self.d.resize(p, 0.0);
        for j in 0..p {
            self.eliminate(j);
        }
    }

    /// Copies A, b and B to where they are eliminated, A to a unit diagonal.
    #[inline(always)]
    fn equilibrate(&mut self, gram: &Gram, r: usize) {
        let p = self.p;
        self.scale.clear();
        self.scale.extend((0..p).map(|i| {
            let energy = f64::from(gram.a[i * p + i]);
            if energy > f64::MIN_POSITIVE { energy.sqrt().recip() } else { 0.0 }
        }));
        self.system.clear(p, p + r);
        self.noise.clear(p, p);
        for (i, &own) in self.scale.iter().enumerate() {
            let (system, noise) = (self.system.row_mut(i), self.noise.row_mut(i));
            for k in i..p {
                let scale = own * self.scale[k];
                system[k] = f64::from(gram.a[k * p + i]) * scale;
                noise[k] = f64::from(gram.b[k * p + i]) * scale;
            }
            for (t, z) in system[p..p + r].iter_mut().enumerate() {
                *z = f64::from(gram.rhs[t * p + i]) * own;
            }
        }
    }

    /// Takes column `j` out of the rows behind it: A by its Cholesky step, b with it, and B by the
    /// congruence B ← E B Eᵀ whose E is that step. With u = L's column j and v = B_j/L_jj − ½ d_j u
    /// the latter is B_ik ← B_ik − u_i v_k − v_i u_k, and d_j = B_jj/A_jj.
    #[inline(always)]
    fn eliminate(&mut self, j: usize) {
        let p = self.p;
        let (width, noise_width) = (self.system.width, self.noise.width);
        let (u, rows) = self.system.split(j);
        let (v, noise_rows) = self.noise.split(j);
        let pivot = u.as_flattened()[j];
        if pivot.is_nan() || pivot <= PIVOT_THRESHOLD {
            return;
        }
        let inverse = pivot.sqrt().recip();
        let d = v.as_flattened()[j] / pivot;
        self.d[j] = d.max(0.0);
        u.as_flattened_mut()[j..].iter_mut().for_each(|u| *u *= inverse);
        for (v, u) in v.as_flattened_mut()[j..].iter_mut().zip(&u.as_flattened()[j..]) {
            *v = *v * inverse - 0.5 * d * u;
        }
        for (t, z) in u.as_flattened()[p..].iter().enumerate().take(self.z.len() / p) {
            self.z[t * p + j] = *z;
        }
        self.l[j * p + j] = u.as_flattened()[j];
        let behind = rows.chunks_exact_mut(width).zip(noise_rows.chunks_exact_mut(noise_width));
        for (i, (row, noise_row)) in (j + 1..p).zip(behind) {
            let (ui, vi) = (u.as_flattened()[i], v.as_flattened()[i]);
            self.l[i * p + j] = ui;
            let from = i / BLOCK;
            for (row, u) in row[from..].iter_mut().zip(&u[from..]) {
                (0..BLOCK).for_each(|k| row[k] -= ui * u[k]);
            }
            for ((row, u), v) in noise_row[from..].iter_mut().zip(&u[from..]).zip(&v[from..]) {
                (0..BLOCK).for_each(|k| row[k] -= ui * v[k] + vi * u[k]);
            }
        }
    }

    /// L⁻¹ b of right-hand side `t`.
    pub fn z(&self, t: usize) -> &[f64] {
        &self.z[t * self.p..(t + 1) * self.p]
    }

    /// diag(L⁻¹ B L⁻ᵀ).
    pub fn d(&self) -> &[f64] {
        &self.d
    }

    /// The coefficients L⁻ᵀ (shrink ∘ z_t) of right-hand side `t`, in the units of the columns.
    #[inline(always)]
    pub fn coefficients(&self, t: usize, shrink: &[f64], beta: &mut Vec<f64>) {
        let p = self.p;
        beta.clear();
        beta.extend(self.z(t).iter().zip(shrink).map(|(z, s)| z * s));
        for i in (0..p).rev() {
            let row = &self.l[i * p..i * p + p];
            if row[i] > 0.0 {
                beta[i] /= row[i];
                let value = beta[i];
                beta[..i].iter_mut().zip(row).for_each(|(b, l)| *b -= l * value);
            } else {
                beta[i] = 0.0;
            }
        }
        beta.iter_mut().zip(&self.scale).for_each(|(b, s)| *b *= s);
    }
}
