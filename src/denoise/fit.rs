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

/// The factorisation of one window's normal equations; buffers are kept between windows.
#[derive(Debug, Clone, Default)]
pub struct Factor {
    p: usize,
    r: usize,
    /// 1/√A_ii, 0 for an empty column.
    scale: Vec<f64>,
    /// L of the equilibrated A, row major; a dropped column has L_ii = 0.
    l: Vec<f64>,
    /// L⁻¹ b, one row of p per right-hand side.
    z: Vec<f64>,
    /// diag(L⁻¹ B L⁻ᵀ).
    d: Vec<f64>,
    /// Scratch for L⁻¹ B and for one row of it.
    c: Vec<f64>,
    row: Vec<f64>,
}

impl Factor {
    /// Factorises `gram`, which has `p` columns and `r` right-hand sides.
    #[inline(always)]
    pub fn factorise(&mut self, gram: &Gram, p: usize, r: usize) {
        (self.p, self.r) = (p, r);
        self.scale.clear();
        self.scale.extend((0..p).map(|i| {
            let energy = f64::from(gram.a[i * p + i]);
            if energy > f64::MIN_POSITIVE { energy.sqrt().recip() } else { 0.0 }
        }));
        self.cholesky(gram);
        self.project(gram);
        self.noise_gain(gram);
    }

    #[inline(always)]
    fn cholesky(&mut self, gram: &Gram) {
        let (p, s) = (self.p, &self.scale);
        self.l.clear();
        self.l.resize(p * p, 0.0);
        for i in 0..p {
            let (above, rest) = self.l.split_at_mut(i * p);
            let row = &mut rest[..p];
            for j in 0..i {
                let lj = &above[j * p..j * p + p];
                if lj[j] > 0.0 {
                    let dot: f64 = row[..j].iter().zip(lj).map(|(a, b)| a * b).sum();
                    row[j] = (f64::from(gram.a[i * p + j]) * s[i] * s[j] - dot) / lj[j];
                }
            }
            let pivot =
                f64::from(gram.a[i * p + i]) * s[i] * s[i] - row[..i].iter().map(|l| l * l).sum::<f64>();
            row[i] = if pivot > PIVOT_THRESHOLD { pivot.sqrt() } else { 0.0 };
        }
    }

    /// z = L⁻¹ b.
    #[inline(always)]
    fn project(&mut self, gram: &Gram) {
        let p = self.p;
        self.z.clear();
        self.z.resize(self.r * p, 0.0);
        for (z, b) in self.z.chunks_mut(p).zip(gram.rhs.chunks(p)) {
            for i in 0..p {
                let row = &self.l[i * p..i * p + p];
                if row[i] > 0.0 {
                    let dot: f64 = row[..i].iter().zip(&*z).map(|(l, z)| l * z).sum();
                    z[i] = (f64::from(b[i]) * self.scale[i] - dot) / row[i];
                }
            }
        }
    }

    /// d = diag(L⁻¹ B L⁻ᵀ): C = L⁻¹ B by rows, then the i-th entry of L⁻¹ applied to row i of C.
    #[inline(always)]
    fn noise_gain(&mut self, gram: &Gram) {
        let p = self.p;
        self.c.clear();
        self.c.resize(p * p, 0.0);
        self.d.clear();
        self.d.resize(p, 0.0);
        self.row.resize(p, 0.0);
        for i in 0..p {
            let lrow = &self.l[i * p..i * p + p];
            if lrow[i] == 0.0 {
                continue;
            }
            let (above, rest) = self.c.split_at_mut(i * p);
            let row = &mut rest[..p];
            for (k, value) in row.iter_mut().enumerate() {
                let entry = if k <= i { gram.b[i * p + k] } else { gram.b[k * p + i] };
                *value = f64::from(entry) * self.scale[i] * self.scale[k];
            }
            for m in 0..i {
                let factor = lrow[m];
                for (value, upper) in row.iter_mut().zip(&above[m * p..m * p + p]) {
                    *value -= factor * upper;
                }
            }
            let inverse = lrow[i].recip();
            row.iter_mut().for_each(|value| *value *= inverse);
            for k in 0..=i {
                let lk = &self.l[k * p..k * p + p];
                self.row[k] = 0.0;
                if lk[k] > 0.0 {
                    let dot: f64 = lk[..k].iter().zip(&self.row).map(|(l, e)| l * e).sum();
                    self.row[k] = (row[k] - dot) / lk[k];
                }
            }
            self.d[i] = self.row[i].max(0.0);
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
