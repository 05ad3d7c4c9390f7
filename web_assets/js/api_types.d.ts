// What each address of the API takes and answers, from the studio's own OpenAPI document (make
// check writes build/api.d.ts).

import type { components, paths } from "../../build/api";

/** The API's values by name, for example Schemas["SessionView"]. */
export type Schemas = components["schemas"];
/** A message of the event socket (events.js). */
export type Message = Schemas["EventMessage"];
export type MessageType = Message["type"];
/** The messages of a type, for example MessageOf<"state">. */
export type MessageOf<T extends MessageType> = Extract<Message, { type: T }>;
type Method = "get" | "put" | "post" | "patch" | "delete";

type Pattern<K> = K extends `${infer Before}{${string}}${infer After}`
  ? `${Before}${string}${Pattern<After>}`
  : K;
type Bare<P> = P extends `${infer Before}?${string}` ? Before : P;
type Same<A, B> = [A] extends [B] ? ([B] extends [A] ? true : false) : false;
type Route<P, M extends Method> = {
  [K in keyof paths]: Same<Bare<P>, Pattern<K>> extends true ? paths[K][M] : never;
}[keyof paths];
type Content<R> = R extends { content: { "application/json": infer T } } ? T : any;
type Success<R> = R extends { responses: infer A }
  ? Content<A[keyof A & (200 | 201 | 202)]>
  : never;

/**
 * An address that the API has for this method; one that is only known when it is called is taken as
 * it is.
 */
export type Address<P extends string, M extends Method> = P extends `/api/${string}`
  ? [Route<P, M>] extends [never]
    ? never
    : P
  : P;
/** What a call answers. */
export type Answer<P extends string, M extends Method> = P extends `/api/${string}`
  ? Success<Route<P, M>>
  : any;
/** What a call takes. */
export type Body<P extends string, M extends Method> = P extends `/api/${string}`
  ? RequestOf<P, M>
  : any;
type RequestOf<P, M extends Method> =
  Route<P, M> extends { requestBody?: infer B } ? Content<B> : any;
