/* Solves a system of n equations in place by Gaussian elimination with row pivoting; b has count right sides of n. */
static void solve(int n, double *a, int count, double *b)
{
    for (int c = 0; c < n; c++) {
        int best = c;
        for (int r = c + 1; r < n; r++)
            if (fabs(a[r * n + c]) > fabs(a[best * n + c])) best = r;
        for (int j = 0; j < n && best != c; j++) {
            const double other = a[c * n + j];
            a[c * n + j] = a[best * n + j];
            a[best * n + j] = other;
        }
        for (int j = 0; j < count && best != c; j++) {
            const double other = b[j * n + c];
            b[j * n + c] = b[j * n + best];
            b[j * n + best] = other;
        }
        for (int r = c + 1; r < n; r++) {
            const double part = a[r * n + c] / a[c * n + c];
            if (part == 0.0) continue;
            for (int j = c; j < n; j++) a[r * n + j] -= part * a[c * n + j];
            for (int j = 0; j < count; j++) b[j * n + r] -= part * b[j * n + c];
        }
    }
    for (int j = 0; j < count; j++) {
        double *v = b + j * n;
        for (int r = n - 1; r >= 0; r--) {
            for (int c = r + 1; c < n; c++) v[r] -= a[r * n + c] * v[c];
            v[r] /= a[r * n + r];
        }
    }
}
