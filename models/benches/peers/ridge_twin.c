/* The ridge's element kernel a second time, written from the equations alone and in another manner: Cartesian stresses,
 * gradients of the shape functions, hourglass vectors, four corner forces an element. It is the peer of the kernel's
 * benchmark and a check of its numbers. Compiled and driven by `peers/twin.rs`.
 *
 *   cc -O3 -march=native -ffp-contract=fast -fno-math-errno -fno-trapping-math -DREAL=double -DLANES=1 -DOBJECTIVE=1 ridge_twin.c -o twin -lm
 *
 * REAL: double or float. LANES: cases side by side, each with its own material, load, friction and plate (1: one case along
 * its rows). OBJECTIVE: velocity strain on the moving geometry with the stress turned by the spin, or 0: small strain.
 *
 * Standard input gives what `main` reads, numbers in binary; then commands, each answered at once:
 *   'r' steps(i64)  first(i64)  runs the kernel; answers CPU seconds (f64), and per lane mean normal and lateral force, f64
 *   's'             answers x, y, vx, vy of all nodes, then sxx, syy, sxy of all elements, lane by lane within each, f64
 *   'l' normal(f64) lateral(f64)   sets the dead loads on every lane
 *   'v'             answers the mean vertical velocity of the spot, per lane, f64
 *   'q'             ends. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef REAL real;
enum { L = LANES };

static void get(void *to, size_t bytes) {
    if (fread(to, 1, bytes, stdin) != bytes) exit(2);
}
static double number(void) { double d; get(&d, sizeof d); return d; }
static int64_t whole(void) { int64_t d; get(&d, sizeof d); return d; }
static void put(double d) { fwrite(&d, sizeof d, 1, stdout); }
static real *field(size_t n) {
    size_t bytes = (n * sizeof(real) + 127) / 64 * 64;
    real *p = aligned_alloc(64, bytes);
    if (!p) exit(3);
    memset(p, 0, bytes);
    return p;
}

static int nx, ny, W, S; /* elements across and up; values in an element row and in a node row */
static real *x, *y, *vx, *vy, *inv_mass, *load_x, *load_y;
static real *sxx, *syy, *sxy, *hgx, *hgy, *hg_stiff, *len;
static real *gb1x, *gb1y, *gb2x, *gb2y, *over_2a, *warpx, *warpy; /* first geometry, small strain */
static real *lam_g, *shear_g, *q_lin, *q_quad;                   /* per element row and lane */
static real *f[2][8];  /* corner forces x, y of two element rows in turn */
static real *penalty, *stretch, *press;
static double dt, damping, period_width;
static double height_sine[L], omega[L], plate_speed[L], mu0[L];
static double *base_share, *spot; static int base_row;
static double sum_normal[L], sum_lateral[L];

/* Stresses of element row j, and the forces of its corners, numbered as they go round. */
static inline __attribute__((always_inline)) void element_row(int j, real *restrict *force) {
    const int W_ = W, o = j * S, p = (j + 1) * S, e0 = j * W;
#if OBJECTIVE
    const real *restrict xa = x + o, *restrict xd = x + p, *restrict ya = y + o, *restrict yd = y + p;
    const real one = 1, half = (real)0.5;
#else
    const real *restrict G1x = gb1x + e0, *restrict G1y = gb1y + e0, *restrict G2x = gb2x + e0, *restrict G2y = gb2y + e0;
    const real *restrict GC = over_2a + e0, *restrict WX = warpx + e0, *restrict WY = warpy + e0;
#endif
    const real *restrict ua = vx + o, *restrict ud = vx + p, *restrict va = vy + o, *restrict vd = vy + p;
    real *restrict a = sxx + e0, *restrict b = syy + e0, *restrict c = sxy + e0;
    real *restrict hx = hgx + e0, *restrict hy = hgy + e0;
    const real *restrict kh = hg_stiff + e0, *restrict ln = len + e0;
    real *restrict f1x = force[0], *restrict f1y = force[1], *restrict f2x = force[2], *restrict f2y = force[3];
    real *restrict f3x = force[4], *restrict f3y = force[5], *restrict f4x = force[6], *restrict f4y = force[7];
    const real h = (real)dt, quarter = (real)0.25, zero = 0;
#if LANES == 1
    const real lg = lam_g[j], gg = shear_g[j], q1 = q_lin[j], q2 = q_quad[j];
#pragma GCC ivdep
    for (int k = 0; k < W_; k++) {
#else
    for (int i = 0; i < W_; i += L)
#pragma GCC ivdep
    for (int lane = 0; lane < L; lane++) {
        const int k = i + lane;
        const real lg = lam_g[j * L + lane], gg = shear_g[j * L + lane], q1 = q_lin[j * L + lane], q2 = q_quad[j * L + lane];
#endif
        const real u1 = ua[k], u2 = ua[k + L], u3 = ud[k + L], u4 = ud[k];
        const real w1 = va[k], w2 = va[k + L], w3 = vd[k + L], w4 = vd[k];
        /* b1 = gradient of corner 1 times area = (y2 - y4, x4 - x2) / 2, b2 = (y3 - y1, x1 - x3) / 2. */
#if OBJECTIVE
        const real x1 = xa[k], x2 = xa[k + L], x3 = xd[k + L], x4 = xd[k];
        const real y1 = ya[k], y2 = ya[k + L], y3 = yd[k + L], y4 = yd[k];
        const real b1x = half * (y2 - y4), b1y = half * (x4 - x2), b2x = half * (y3 - y1), b2y = half * (x1 - x3);
        const real over = quarter / (b1x * b2y - b1y * b2x); /* one over twice the area */
        const real gx = x1 - x2 + x3 - x4, gy = y1 - y2 + y3 - y4;
#else
        const real b1x = G1x[k], b1y = G1y[k], b2x = G2x[k], b2y = G2y[k], over = GC[k], gx = WX[k], gy = WY[k];
#endif
        const real u13 = u1 - u3, u24 = u2 - u4, w13 = w1 - w3, w24 = w2 - w4;
        const real t = h * (over + over); /* time step over area */
        const real dxx = t * (b1x * u13 + b2x * u24), dxy = t * (b1y * u13 + b2y * u24);
        const real dyx = t * (b1x * w13 + b2x * w24), dyy = t * (b1y * w13 + b2y * w24);
        const real qx = quarter * (h * (u1 - u2 + u3 - u4) - gx * dxx - gy * dxy);
        const real qy = quarter * (h * (w1 - w2 + w3 - w4) - gx * dyx - gy * dyy);
        real A = a[k], B = b[k], C = c[k], HX = hx[k], HY = hy[k];
#if OBJECTIVE
        const real spin = half * (dyx - dxy), twice = dyx - dxy;
        const real bend = one - half * twice * twice, lean = one - half * spin * spin;
        const real mean = half * (A + B), dev = half * (A - B);
        const real dev_t = dev * bend - C * twice;
        C = C * bend + dev * twice;
        A = mean + dev_t;
        B = mean - dev_t;
        const real HXt = HX * lean - HY * spin;
        HY = HY * lean + HX * spin;
        HX = HXt;
#endif
        const real tr = dxx + dyy, d2 = gg * (dxx - dyy), vol = lg * tr;
        A += vol + d2;
        B += vol - d2;
        C += gg * (dxy + dyx);
        HX += kh[k] * qx;
        HY += kh[k] * qy;
        a[k] = A; b[k] = B; c[k] = C; hx[k] = HX; hy[k] = HY;
        const real ell = ln[k], closing = (tr < zero ? tr : zero) * ell;
        const real q = q1 * ell * tr - q2 * closing * closing;
        const real P = A + q, Q = B + q;
        /* Internal force at corner c: area gradient . stress + hourglass force times gamma_c. */
        const real kx = quarter * HX, ky = quarter * HY;
        const real ox = (over + over) * kx, oy = (over + over) * ky;
        const real X1 = P - ox * gx, Y1 = C - ox * gy, X2 = C - oy * gx, Y2 = Q - oy * gy;
        const real s1x = b1x * X1 + b1y * Y1, s2x = b2x * X1 + b2y * Y1;
        const real s1y = b1x * X2 + b1y * Y2, s2y = b2x * X2 + b2y * Y2;
        f1x[k] = s1x + kx; f1y[k] = s1y + ky;
        f2x[k] = s2x - kx; f2y[k] = s2y - ky;
        f3x[k] = kx - s1x; f3y[k] = ky - s1y;
        f4x[k] = -kx - s2x; f4y[k] = -ky - s2y;
    }
}

/* Pushes node row j; `below` and `above` are the corner forces of the element rows beside it (one may be none). */
static inline __attribute__((always_inline)) void node_row(int j, real *restrict *below, real *restrict *above, const real *restrict cx,
                                                            const real *restrict cy) {
    const int W_ = W, o = j * S;
    const real keep = (real)((1 - 0.5 * damping * dt) / (1 + 0.5 * damping * dt)), push = (real)(dt / (1 + 0.5 * damping * dt));
    const real step = (real)(0.5 * dt);
    real *restrict px = x + o, *restrict py = y + o, *restrict ux = vx + o, *restrict uy = vy + o;
    const real *restrict lx = load_x + o, *restrict ly = load_y + o, *restrict im = inv_mass + o;
    /* Corner 2 and 3 forces belong to the node on the right: rows are kept with one free place before them. */
    const real *restrict b1x = below[0], *restrict b1y = below[1], *restrict b2x = below[2] - L, *restrict b2y = below[3] - L;
    const real *restrict a3x = above[4] - L, *restrict a3y = above[5] - L, *restrict a4x = above[6], *restrict a4y = above[7];
#pragma GCC ivdep
    for (int k = 0; k < W_; k++) {
        const real fx = lx[k] + cx[k] - (b1x[k] + b2x[k] + a3x[k] + a4x[k]);
        const real fy = ly[k] + cy[k] - (b1y[k] + b2y[k] + a3y[k] + a4y[k]);
        const real g = push * im[k];
        const real nx_ = keep * ux[k] + g * fx, ny_ = keep * uy[k] + g * fy;
        px[k] += step * (ux[k] + nx_);
        py[k] += step * (uy[k] + ny_);
        ux[k] = nx_;
        uy[k] = ny_;
    }
    for (int l = 0; l < L; l++) {
        px[W + l] = px[l] + (real)period_width; py[W + l] = py[l];
        ux[W + l] = ux[l]; uy[W + l] = uy[l];
    }
}

static real *contact_x, *contact_y, *nothing_row, *zero_rows[8];

/* Penalty with one Coulomb limit for the whole ridge. */
static void contact(int64_t step) {
    real at[L], slide[L], normal[L], lateral[L], share[L];
    for (int l = 0; l < L; l++) {
        at[l] = (real)(height_sine[l] * sin(omega[l] * (double)step * dt));
        slide[l] = (real)plate_speed[l];
        normal[l] = lateral[l] = 0;
    }
    const real half = (real)(0.5 * dt), h = (real)dt;
    for (int i = 0; i < W; i += L)
        for (int l = 0; l < L; l++) {
            const int k = i + l;
            const real depth = at[l] - (y[k] + half * vy[k]);
            const real n = depth > 0 ? penalty[k] * depth : 0;
            const real s = depth > 0 ? stretch[k] + (slide[l] - vx[k]) * h : 0;
            press[k] = n;
            stretch[k] = s;
            normal[l] += n;
            lateral[l] += penalty[k] * s;
        }
    for (int l = 0; l < L; l++) {
        const real limit = (real)mu0[l] * normal[l], size = lateral[l] < 0 ? -lateral[l] : lateral[l];
        share[l] = size > limit ? limit / size : 1;
        sum_normal[l] += normal[l];
        sum_lateral[l] += lateral[l] * share[l];
    }
    for (int i = 0; i < W; i += L)
        for (int l = 0; l < L; l++) {
            const int k = i + l;
            stretch[k] *= share[l];
            contact_x[k] = penalty[k] * stretch[k];
            contact_y[k] = press[k];
        }
}

/* What the last column gives to the closing node belongs to the first node: copied into the free place before the row. */
static inline void wrap(real **force) {
    for (int c = 2; c < 6; c++)
        for (int l = 0; l < L; l++) force[c][l - L] = force[c][W - L + l];
}

static void run(int64_t steps, int64_t first) {
    for (int64_t n = 0; n < steps; n++) {
        real **above = zero_rows;
        for (int j = 0; j < ny; j++) {
            real **here = f[j & 1];
            element_row(j, here);
            wrap(here);
            if (j == 0) contact(first + n);
            node_row(j, here, above, j ? nothing_row : contact_x, j ? nothing_row : contact_y);
            above = here;
        }
        node_row(ny, zero_rows, above, nothing_row, nothing_row);
    }
}

static double cpu_seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int main(void) {
    nx = (int)whole(); ny = (int)whole();
    W = nx * L; S = (nx + 8) * L;
    const size_t nodes = (size_t)S * (ny + 1), elements = (size_t)W * ny;
    real **all[] = {&x, &y, &vx, &vy, &inv_mass, &load_x, &load_y};
    for (int k = 0; k < 7; k++) *all[k] = field(nodes);
    real **el[] = {&sxx, &syy, &sxy, &hgx, &hgy, &hg_stiff, &len, &gb1x, &gb1y, &gb2x, &gb2y, &over_2a, &warpx, &warpy};
    for (int k = 0; k < 14; k++) *el[k] = field(elements);
    real **law[] = {&lam_g, &shear_g, &q_lin, &q_quad};
    for (int k = 0; k < 4; k++) *law[k] = field((size_t)ny * L);
    /* A force row has free places before it, for what the last column gives to the first node. */
    for (int r = 0; r < 2; r++)
        for (int c = 0; c < 8; c++) f[r][c] = field((size_t)W + 64 + 8 * L) + 64;
    for (int c = 0; c < 8; c++) zero_rows[c] = field((size_t)W + 64 + 8 * L) + 64;
    real **rows[] = {&penalty, &stretch, &press, &contact_x, &contact_y, &nothing_row};
    for (int k = 0; k < 6; k++) *rows[k] = field((size_t)W + 8 * L);

    dt = number(); damping = number(); period_width = number();
    base_row = (int)whole();
    base_share = calloc(nx, sizeof *base_share); spot = calloc(nx, sizeof *spot);
    for (int i = 0; i < nx; i++) base_share[i] = number();
    for (int i = 0; i < nx; i++) spot[i] = number();
    double *X = malloc(nodes * sizeof *X), *Y = malloc(nodes * sizeof *Y), *M = calloc(nodes, sizeof *M);
    for (int j = 0; j <= ny; j++)
        for (int i = 0; i <= nx; i++) { X[j * (nx + 1) + i] = number(); Y[j * (nx + 1) + i] = number(); }
    for (int l = 0; l < L; l++) {
        double sine = number(), frequency = number();
        height_sine[l] = sine; omega[l] = 2 * M_PI * frequency; plate_speed[l] = number(); mu0[l] = number();
        for (int i = 0; i < nx; i++) penalty[i * L + l] = (real)number();
        memset(M, 0, nodes * sizeof *M);
        for (int j = 0; j < ny; j++) {
            const double E = number(), nu = number(), rho = number();
            const double G = E / (2 * (1 + nu)), lambda = E * nu / ((1 + nu) * (1 - 2 * nu)), P = lambda + 2 * G;
            lam_g[j * L + l] = (real)(lambda + G);
            shear_g[j * L + l] = (real)G;
            q_lin[j * L + l] = (real)(0.06 * rho * sqrt(P / rho) / dt);
            q_quad[j * L + l] = (real)(1.2 * 1.2 * rho / (dt * dt));
            for (int i = 0; i < nx; i++) {
                const int n1 = j * (nx + 1) + i, n2 = n1 + 1, n4 = n1 + nx + 1, n3 = n4 + 1;
                const double A = 0.5 * ((X[n3] - X[n1]) * (Y[n4] - Y[n2]) - (X[n4] - X[n2]) * (Y[n3] - Y[n1]));
                const double bx[2] = {0.5 * (Y[n2] - Y[n4]), 0.5 * (Y[n3] - Y[n1])};
                const double by[2] = {0.5 * (X[n4] - X[n2]), 0.5 * (X[n1] - X[n3])};
                const double bb = 2 * (bx[0] * bx[0] + bx[1] * bx[1] + by[0] * by[0] + by[1] * by[1]) / (A * A);
                const int e = j * W + i * L + l;
                gb1x[e] = (real)bx[0]; gb1y[e] = (real)by[0]; gb2x[e] = (real)bx[1]; gb2y[e] = (real)by[1];
                over_2a[e] = (real)(0.5 / A);
                warpx[e] = (real)(X[n1] - X[n2] + X[n3] - X[n4]); warpy[e] = (real)(Y[n1] - Y[n2] + Y[n3] - Y[n4]);
                hg_stiff[e] = (real)(0.1 * P * A * bb);
                len[e] = (real)sqrt(1 / bb);
                M[n1] += 0.25 * rho * A; M[n2] += 0.25 * rho * A; M[n3] += 0.25 * rho * A; M[n4] += 0.25 * rho * A;
            }
        }
        for (int j = 0; j <= ny; j++)
            for (int i = 0; i <= nx; i++) {
                const int k = j * S + i * L + l, n = j * (nx + 1) + i;
                x[k] = (real)X[n]; y[k] = (real)Y[n];
                double m = M[n];
                if (i == 0 || i == nx) m = M[j * (nx + 1)] + M[j * (nx + 1) + nx];
                inv_mass[k] = j == ny ? 0 : (real)(1 / m); /* the top is held */
            }
    }
    fputc('k', stdout); fflush(stdout);
    for (int c; (c = fgetc(stdin)) != EOF && c != 'q';) {
        if (c == 'r') {
            const int64_t steps = whole(), first = whole();
            memset(sum_normal, 0, sizeof sum_normal); memset(sum_lateral, 0, sizeof sum_lateral);
            const double start = cpu_seconds();
            run(steps, first);
            put(cpu_seconds() - start);
            for (int l = 0; l < L; l++) { put(sum_normal[l] / (double)steps); put(sum_lateral[l] / (double)steps); }
        } else if (c == 'l') {
            const double normal = number(), lateral = number();
            for (int i = 0; i < W; i++) {
                load_x[base_row * S + i] = (real)(-lateral * base_share[i / L]);
                load_y[base_row * S + i] = (real)(-normal * base_share[i / L]);
            }
            continue;
        } else if (c == 'a') { /* another amplitude, on every lane */
            const double sine = number(), speed = number();
            for (int l = 0; l < L; l++) { height_sine[l] = sine; plate_speed[l] = speed; }
            continue;
        } else if (c == 'v') {
            for (int l = 0; l < L; l++) {
                double v = 0;
                for (int i = 0; i < nx; i++) v += spot[i] * vy[i * L + l];
                put(v);
            }
        } else if (c == 's') {
            real *nodal[] = {x, y, vx, vy}, *elemental[] = {sxx, syy, sxy};
            for (int q = 0; q < 4; q++)
                for (int j = 0; j <= ny; j++)
                    for (int k = 0; k < (nx + 1) * L; k++) put(nodal[q][j * S + k]);
            for (int q = 0; q < 3; q++)
                for (size_t k = 0; k < elements; k++) put(elemental[q][k]);
        }
        fflush(stdout);
    }
    return 0;
}
