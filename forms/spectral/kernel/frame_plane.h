/* The frame of F in plane strain, in closed form.
 *
 * With R(a) the rotation by a, M(a) the reflection [cos a, sin a; sin a, -cos a], and directions at angles α and β,
 *
 *   F = U diag(s) Vᵀ = (s_0 + s_1)/2 R(α - β) + (s_0 - s_1)/2 M(α + β),
 *
 * and both terms are read off F.
 */

/* (cos, sin) along (x, y), of length r; of angle zero where r is. */
static inline void unit(lanes x, lanes y, lanes r, lanes *cosine, lanes *sine)
{
  const mask none = r == 0;
  const lanes over = 1 / choose(none, all(1), r);
  *cosine = choose(none, all(1), x * over);
  *sine = y * over;
}

/* H[i][j] = ∂u_i/∂X_j. */
static inline void decompose(const lanes H[3][3], struct frame *f)
{
  const lanes trace = H[0][0] + H[1][1];
  lanes cos_turn = all(1), sin_turn = all(0);
#if OBJECTIVE
  const lanes x = 1 + 0.5 * trace, y = 0.5 * (H[1][0] - H[0][1]);
  const lanes mean = root(x * x + y * y);
  unit(x, y, mean, &cos_turn, &sin_turn);
  /* mean - 1 without cancellation. */
  const lanes excess = (trace * (1 + 0.25 * trace) + y * y) / (mean + 1);
#else
  const lanes excess = 0.5 * trace;
#endif
  const lanes v = 0.5 * (H[0][0] - H[1][1]), w = 0.5 * (H[1][0] + H[0][1]);
  const lanes half_gap = root(v * v + w * w);

  /* cos and sin of 2β times half the gap. The smaller of the two angles that serve has no cancellation: the longer
   * stretch is the first or the second. */
  const lanes c = v * cos_turn + w * sin_turn, s = w * cos_turn - v * sin_turn;
  const mask first = c >= 0;
  const lanes along = half_gap + magnitude(c), across = choose(first, s, -s);
  lanes cosine, sine;
  unit(along, across, root(along * along + across * across), &cosine, &sine);

  for (int n = 0; n < 3; ++n)
    for (int i = 0; i < 3; ++i)
      f->U[n][i] = f->V[n][i] = all(n == i);
  f->V[0][0] = f->V[1][1] = cosine;
  f->V[0][1] = sine;
  f->V[1][0] = -sine;
  f->U[0][0] = f->U[1][1] = cos_turn * cosine - sin_turn * sine;
  f->U[0][1] = sin_turn * cosine + cos_turn * sine;
  f->U[1][0] = -f->U[0][1];

  f->small = all(0) == all(0);
  f->e[0] = excess + choose(first, half_gap, -half_gap);
  f->e[1] = excess - choose(first, half_gap, -half_gap);
  f->e[2] = all(0);
#if OBJECTIVE
  /* The smaller one from det F: all its digits. */
  const lanes longer = mean + half_gap;
  const lanes volume = (1 + H[0][0]) * (1 + H[1][1]) - H[0][1] * H[1][0];
  const lanes shorter = volume / choose(longer == 0, all(1), longer);
  f->s[0] = choose(first, longer, shorter);
  f->s[1] = choose(first, shorter, longer);
#else
  f->s[0] = 1 + f->e[0];
  f->s[1] = 1 + f->e[1];
#endif
  f->s[2] = all(1);
}
