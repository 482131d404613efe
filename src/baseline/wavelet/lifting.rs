//! The 9/7 wavelets of Cohen, Daubechies, Feauveau (1992) in one dimension, by the lifting steps of
//! Daubechies and Sweldens (1998), mirrored at the ends; the wavelets of JPEG 2000.
//!
//! Scaled to an amplitude of √2 for constants, so that the filters are nearly orthonormal: white noise
//! keeps its variance to 4 %.

/// The four lifting steps, alternately of odd samples from even ones and the other way round.
const STEPS: [f64; 4] =
    [-1.586_134_342_059_924, -0.052_980_118_572_961, 0.882_911_075_530_934, 0.443_506_852_043_971];

/// Factor on scale coefficients, divisor of detail coefficients.
const SCALE: f64 = 1.149_604_398_860_241;

/// The analysis and synthesis of signals of one length; the scale coefficients come first.
pub struct Bank {
    length: usize,
    /// For every coefficient the squared taps that are not 0, each with its sample.
    squares: Vec<Vec<(usize, f64)>>,
}

impl Bank {
    /// For signals of `length` samples. A single sample is its own scale coefficient.
    pub fn new(length: usize) -> Self {
        let mut bank = Self { length, squares: vec![vec![]; length] };
        let mut impulse = vec![0.0; length];
        for sample in 0..length {
            impulse.fill(0.0);
            impulse[sample] = 1.0;
            bank.forward(&mut impulse);
            for (taps, &tap) in bank.squares.iter_mut().zip(&impulse).filter(|(_, tap)| **tap != 0.0) {
                taps.push((sample, tap * tap));
            }
        }
        bank
    }

    /// The signals' length.
    pub fn len(&self) -> usize {
        self.length
    }

    /// Turns samples into coefficients.
    pub fn forward(&self, signal: &mut [f64]) {
        if self.length == 1 {
            return;
        }
        STEPS.iter().enumerate().for_each(|(i, step)| lift(signal, (i + 1) % 2, *step));
        let odd = signal.iter().skip(1).step_by(2).map(|v| v / SCALE).collect::<Vec<_>>();
        let even = signal.iter().step_by(2).map(|v| v * SCALE).collect::<Vec<_>>();
        signal.iter_mut().zip(even.into_iter().chain(odd)).for_each(|(out, v)| *out = v);
    }

    /// Turns coefficients into samples.
    pub fn inverse(&self, signal: &mut [f64]) {
        if self.length == 1 {
            return;
        }
        let coefficients = signal.to_vec();
        let (even, odd) = coefficients.split_at(self.length.div_ceil(2));
        signal.iter_mut().step_by(2).zip(even).for_each(|(out, v)| *out = v / SCALE);
        signal.iter_mut().skip(1).step_by(2).zip(odd).for_each(|(out, v)| *out = v * SCALE);
        STEPS.iter().enumerate().rev().for_each(|(i, step)| lift(signal, (i + 1) % 2, -step));
    }

    /// Turns the variances of independent samples into those of the coefficients.
    pub fn variance(&self, signal: &mut [f64]) {
        let samples = signal.to_vec();
        for (out, taps) in signal.iter_mut().zip(&self.squares) {
            *out = taps.iter().map(|&(sample, square)| square * samples[sample]).sum();
        }
    }
}

/// Adds `step` times both neighbours to every second sample from `first` on, mirrored at the ends.
fn lift(signal: &mut [f64], first: usize, step: f64) {
    let last = signal.len() - 1;
    for i in (first..=last).step_by(2) {
        let left = if i == 0 { 1 } else { i - 1 };
        let right = if i == last { last - 1 } else { i + 1 };
        signal[i] += step * (signal[left] + signal[right]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_analysed_is_synthesised() {
        for length in [1, 2, 3, 4, 7, 16, 41] {
            let bank = Bank::new(length);
            let signal: Vec<f64> = (0..length).map(|i| ((i * i * 7) % 23) as f64).collect();
            let mut copy = signal.clone();
            bank.forward(&mut copy);
            bank.inverse(&mut copy);
            assert!(signal.iter().zip(&copy).all(|(a, b)| (a - b).abs() < 1e-12), "{length}");
        }
    }

    #[test]
    fn cubics_have_no_detail_and_constants_the_amplitude_of_root_two() {
        let bank = Bank::new(64);
        let mut signal: Vec<f64> = (0..64).map(|i| (i as f64 / 10.0).powi(3)).collect();
        bank.forward(&mut signal);
        // Away from the mirrored ends.
        assert!(signal[32 + 4..64 - 4].iter().all(|v| v.abs() < 1e-9));
        let mut constant = vec![1.0; 64];
        bank.forward(&mut constant);
        assert!(constant[..32].iter().all(|v| (v - 2f64.sqrt()).abs() < 1e-9));
        assert!(constant[32..].iter().all(|v| v.abs() < 1e-9));
    }

    #[test]
    fn white_noise_keeps_its_variance_nearly() {
        let mut variances = vec![1.0; 64];
        Bank::new(64).variance(&mut variances);
        assert!(variances[4..28].iter().chain(&variances[36..60]).all(|v| (v - 1.0).abs() < 0.05));
    }
}
