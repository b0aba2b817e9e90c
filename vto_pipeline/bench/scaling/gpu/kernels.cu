// Kernels of device.py. Each runs as one launch: blocks wait for each other at a gate, so all must be resident
// at once, which they are while there are no more of them than multiprocessors.

#ifndef LANES
#define LANES 32  // threads of a warp
#endif
#define SLICE 32  // rows stored side by side

extern __shared__ double room[];

typedef unsigned long long Count;

// Let no block go on before all have come.
__device__ void wait_for_all(Count* gate) {
    __syncthreads();
    if (threadIdx.x == 0) {
        __threadfence();
        const Count full = (atomicAdd(gate, 1ULL) / gridDim.x + 1) * gridDim.x;
        while (*(volatile Count*)gate < full) {
        }
        __threadfence();
    }
    __syncthreads();
}

// Sum a and b over a block, always in the same order; all its threads get the sums.
__device__ void sum_over_block(double& a, double& b) {
    const int warps = blockDim.x / LANES, warp = threadIdx.x / LANES;
    for (int other = LANES / 2; other > 0; other /= 2) {
        a += __shfl_down_sync(0xffffffff, a, other);
        b += __shfl_down_sync(0xffffffff, b, other);
    }
    __syncthreads();
    if (threadIdx.x % LANES == 0) {
        room[warp] = a;
        room[warps + warp] = b;
    }
    __syncthreads();
    a = b = 0.0;
    for (int k = 0; k < warps; ++k) {
        a += room[k];
        b += room[warps + k];
    }
}

// Sum a and b over all threads. Parts of two turns are kept: a block may still read one while others write the next.
__device__ void sum_over_all(double& a, double& b, double* parts, int& turn, Count* gate) {
    sum_over_block(a, b);
    double* now = parts + 2 * gridDim.x * turn;
    if (threadIdx.x == 0) {
        now[2 * blockIdx.x] = a;
        now[2 * blockIdx.x + 1] = b;
    }
    wait_for_all(gate);
    a = b = 0.0;
    for (int k = threadIdx.x; k < gridDim.x; k += blockDim.x) {
        a += now[2 * k];
        b += now[2 * k + 1];
    }
    sum_over_block(a, b);
    turn = 1 - turn;
}

// Row t of M⁻¹ r, where M is the matrix without what couples one domain, of `width` rows, with another.
__device__ double precondition(int t, int width, const double* __restrict__ inverses, const double* r) {
    const int first = t - t % width;
    const double* inverse = inverses + (size_t)first * width + t % width;
    double sum = 0.0;
    for (int k = 0; k < width; ++k) sum += inverse[(size_t)k * width] * r[first + k];
    return sum;
}

// Solve A x = right by preconditioned conjugate gradients (Hestenes & Stiefel 1952) from x = 0.
// `rows`: scalars, a multiple of blockDim.x, which is one of `width` and of SLICE. The matrix is stored by slices:
// entry k of a row of blocks has its column in columns[SLICE * k + lane] and three values, SLICE apart.
extern "C" __global__ void __launch_bounds__(768) conjugate_gradients(
    int rows, const int* __restrict__ slices, const int* __restrict__ columns, const double* __restrict__ values,
    int width, const double* __restrict__ inverses, const double* __restrict__ right, double* x, double* r, double* z,
    double* p, double* before, double* q, double* parts, Count* gate, double tolerance, int most, double* found) {
    const int begin = blockIdx.x * blockDim.x + threadIdx.x, stride = gridDim.x * blockDim.x;
    int turn = 0, done = 0;
    double rz = 0.0, rr = 0.0, nothing = 0.0;
    for (int t = begin; t < rows; t += stride) {
        x[t] = p[t] = 0.0;
        r[t] = right[t];
        __syncthreads();
        z[t] = precondition(t, width, inverses, r);
        rz += r[t] * z[t];
        rr += r[t] * r[t];
    }
    sum_over_all(rz, rr, parts, turn, gate);
    const double bound = tolerance * tolerance * rr;
    const double whole = rr;
    double beta = 0.0;
    while (done < most && rr > bound) {
        double* last = p;
        p = before;
        before = last;
        double curvature = 0.0;
        for (int t = begin; t < rows; t += stride) {
            const int slice = t / SLICE, lane = t % SLICE;
            double sum = 0.0;
            for (int k = slices[slice]; k < slices[slice + 1]; ++k) {
                const int column = columns[SLICE * k + lane];
                const double* value = values + (size_t)3 * SLICE * k + lane;
                sum += value[0] * (z[column] + beta * last[column]);
                sum += value[SLICE] * (z[column + 1] + beta * last[column + 1]);
                sum += value[2 * SLICE] * (z[column + 2] + beta * last[column + 2]);
            }
            p[t] = z[t] + beta * last[t];
            q[t] = sum;
            curvature += p[t] * sum;
        }
        sum_over_all(curvature, nothing, parts, turn, gate);
        if (!(curvature > 0.0)) break;
        const double alpha = rz / curvature, rz_before = rz;
        rz = rr = 0.0;
        for (int t = begin; t < rows; t += stride) {
            x[t] += alpha * p[t];
            r[t] -= alpha * q[t];
            __syncthreads();
            z[t] = precondition(t, width, inverses, r);
            rz += r[t] * z[t];
            rr += r[t] * r[t];
        }
        sum_over_all(rz, rr, parts, turn, gate);
        beta = rz / rz_before;
        ++done;
    }
    if (begin == 0) {
        found[0] = done;
        found[1] = sqrt(rr / whole);
    }
}

struct Vector {
    double x, y, z;
};

__device__ Vector operator+(Vector a, Vector b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
__device__ Vector operator-(Vector a, Vector b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
__device__ Vector operator*(double s, Vector a) { return {s * a.x, s * a.y, s * a.z}; }
__device__ double dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
__device__ Vector cross(Vector a, Vector b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
__device__ Vector load(const double* x, int i) { return {x[3 * i], x[3 * i + 1], x[3 * i + 2]}; }
__device__ void store(double* x, int i, Vector a) {
    x[3 * i] = a.x;
    x[3 * i + 1] = a.y;
    x[3 * i + 2] = a.z;
}
__device__ double inverse_pivot(double pivot, double before) { return pivot > 1e-13 * before ? 1.0 / pivot : 0.0; }

// A step of XPBD on the warp, weft and shear strain of a triangle; see cloth.constraints.membrane.stretch.
__device__ void project_triangle(
    int t, double* x, const double* __restrict__ w, const int* __restrict__ corners,
    const double* __restrict__ gradients, const double* __restrict__ area, const double* __restrict__ compliance,
    double* lambdas, double h) {
    const int c[3] = {corners[3 * t], corners[3 * t + 1], corners[3 * t + 2]};
    const double* g = gradients + 6 * t;
    Vector place[3], fu = {0.0, 0.0, 0.0}, fv = fu;
    double aa = 0.0, ab = 0.0, bb = 0.0;
    for (int k = 0; k < 3; ++k) {
        place[k] = load(x, c[k]);
        fu = fu + g[2 * k] * place[k];
        fv = fv + g[2 * k + 1] * place[k];
        aa += w[c[k]] * g[2 * k] * g[2 * k];
        ab += w[c[k]] * g[2 * k] * g[2 * k + 1];
        bb += w[c[k]] * g[2 * k + 1] * g[2 * k + 1];
    }
    const double long_u = sqrt(dot(fu, fu)), long_v = sqrt(dot(fv, fv));
    const Vector u = (1.0 / long_u) * fu, v = (1.0 / long_v) * fv;
    const double sine = fmin(1.0, fmax(-1.0, dot(u, v))), cosine = sqrt(1.0 - sine * sine);
    const Vector p = (1.0 / (long_u * cosine)) * (v - sine * u), q = (1.0 / (long_v * cosine)) * (u - sine * v);
    const double over = 1.0 / (area[t] * h * h);
    const double suu = over * compliance[0], svv = over * compliance[1], sss = over * compliance[2];
    const double suv = over * compliance[3];
    double* l = lambdas + 3 * t;
    const double ru = -(long_u - 1.0) - suu * l[0] - suv * l[1];
    const double rv = -(long_v - 1.0) - suv * l[0] - svv * l[1];
    const double rs = -asin(sine) - sss * l[2];
    const double a = aa * dot(u, u) + suu, b = ab * dot(u, v) + suv, d = bb * dot(v, v) + svv;
    const double m = dot(u, aa * p + ab * q), e = dot(v, ab * p + bb * q);
    const double f = aa * dot(p, p) + 2.0 * ab * dot(p, q) + bb * dot(q, q) + sss;
    const double p1 = inverse_pivot(a, a), l1 = b * p1, l2 = m * p1;
    const double p2 = inverse_pivot(d - l1 * b, d), n = e - l1 * m, l3 = n * p2;
    const double y = rv - l1 * ru;
    const double s3 = (rs - l2 * ru - l3 * y) * inverse_pivot(f - l2 * m - l3 * n, f);
    const double s2 = y * p2 - l3 * s3;
    const double s1 = ru * p1 - l1 * s2 - l2 * s3;
    l[0] += s1;
    l[1] += s2;
    l[2] += s3;
    const Vector pull_u = s3 * p + s1 * u, pull_v = s3 * q + s2 * v;
    for (int k = 0; k < 3; ++k) store(x, c[k], w[c[k]] * (g[2 * k] * pull_u + g[2 * k + 1] * pull_v) + place[k]);
}

// A step of XPBD on the angle of a hinge; see cloth.constraints.bending.hinge.
__device__ void project_hinge(
    int i, double* x, const double* __restrict__ w, const int* __restrict__ vertices,
    const double* __restrict__ rest, const double* __restrict__ compliance, double* lambdas, double h) {
    const int* c = vertices + 4 * i;
    const Vector x0 = load(x, c[0]), x1 = load(x, c[1]), x2 = load(x, c[2]), x3 = load(x, c[3]);
    const Vector e = x1 - x0, n2 = cross(e, x2 - x0), n3 = cross(x3 - x0, e);
    const double length = sqrt(dot(e, e)), area2 = dot(n2, n2), area3 = dot(n3, n3);
    const double least = 1e-30 * length * length * length * length;
    if (length == 0.0 || area2 < least || area3 < least) return;
    const double angle = atan2(dot(cross(n2, n3), e) / length, dot(n2, n3));
    const Vector g2 = (-length / area2) * n2, g3 = (-length / area3) * n3;
    const double t2 = dot(x2 - x0, e) / (length * length), t3 = dot(x3 - x0, e) / (length * length);
    const Vector g0 = (t2 - 1.0) * g2 + (t3 - 1.0) * g3, g1 = (-t2) * g2 + (-t3) * g3;
    const double weight = w[c[0]] * dot(g0, g0) + w[c[1]] * dot(g1, g1) + w[c[2]] * dot(g2, g2) + w[c[3]] * dot(g3, g3);
    if (weight == 0.0) return;
    const double soft = compliance[i] / (h * h);
    const double shift = (-(angle - rest[i]) - soft * lambdas[i]) / (weight + soft);
    lambdas[i] += shift;
    store(x, c[0], (shift * w[c[0]]) * g0 + x0);
    store(x, c[1], (shift * w[c[1]]) * g1 + x1);
    store(x, c[2], (shift * w[c[2]]) * g2 + x2);
    store(x, c[3], (shift * w[c[3]]) * g3 + x3);
}

// Sweep over all triangles, then over all hinges, colour by colour: the constraints of a colour share no vertex.
extern "C" __global__ void __launch_bounds__(256) sweeps(
    int count, double h, double* x, const double* __restrict__ w, int triangle_colours,
    const long long* __restrict__ triangle_starts, const int* __restrict__ corners,
    const double* __restrict__ gradients, const double* __restrict__ area, const double* __restrict__ compliance,
    double* strain_lambdas, int hinge_colours, const long long* __restrict__ hinge_starts,
    const int* __restrict__ vertices, const double* __restrict__ rest, const double* __restrict__ bend_compliance,
    double* bend_lambdas, Count* gate) {
    const int begin = blockIdx.x * blockDim.x + threadIdx.x, stride = gridDim.x * blockDim.x;
    for (int sweep = 0; sweep < count; ++sweep) {
        for (int colour = 0; colour < hinge_colours; ++colour) {
            for (int i = (int)hinge_starts[colour] + begin; i < hinge_starts[colour + 1]; i += stride)
                project_hinge(i, x, w, vertices, rest, bend_compliance, bend_lambdas, h);
            wait_for_all(gate);
        }
        for (int colour = 0; colour < triangle_colours; ++colour) {
            for (int t = (int)triangle_starts[colour] + begin; t < triangle_starts[colour + 1]; t += stride)
                project_triangle(t, x, w, corners, gradients, area, compliance, strain_lambdas, h);
            wait_for_all(gate);
        }
    }
}

// Only the gate: what waiting costs.
extern "C" __global__ void gates(int count, Count* gate) {
    for (int k = 0; k < count; ++k) wait_for_all(gate);
}
